"""The command `run-study`. Signals are handled from the first moment, before slow imports."""

from __future__ import annotations

import sys
from collections.abc import Sequence

from studyrunner.system.endings import INTERRUPTED, begin_ending, is_ending, take_endings


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command on this rank and returns its exit status; an unexpected failure ends all ranks.

    Parameters
    ----------
    arguments
        None for those of the process, which ends here if the run did not come to its end.
    """
    try:
        take_endings()
        from studyrunner.command import run_command

        return run_command(arguments)
    except BaseException as error:
        if not is_ending(error):
            raise
        begin_ending()
        from studyrunner.mpi.ranks import launcher_rank

        if launcher_rank() == 0:
            print("run-study: interrupted", file=sys.stderr)
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
