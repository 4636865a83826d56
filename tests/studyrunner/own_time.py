"""Time without that in which others of the machine had the processor: limits of time are those of a machine at rest."""

import time
from pathlib import Path


def seconds_waited(process: str = "thread-self") -> float:
    """Seconds that a process, or this thread, was able to go on and had no processor; 0 where the system cannot say."""
    try:
        return 1e-9 * int(Path(f"/proc/{process}/schedstat").read_text(encoding="ascii").split()[1])
    except (OSError, IndexError, ValueError):
        return 0.0


class Stopwatch:
    """Runs from its start on."""

    def __init__(self) -> None:
        self._began = time.monotonic()
        self._waited = seconds_waited()

    def seconds(self, others: float = 0.0) -> float:
        """Seconds that it took. others: that processes waited which this one waited for in turn."""
        return time.monotonic() - self._began - (seconds_waited() - self._waited) - others
