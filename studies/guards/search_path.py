"""Search path of modules without the current folder, where a file beside a study could replace a library."""

from __future__ import annotations

import os
import sys

# in the words of os: pathlib would be loaded from where it is not known yet
_OWN = os.path.realpath(os.path.join(__file__, "..", "..", ".."))  # noqa: PTH118
_PYTHONS = os.path.realpath(os.path.join(os.__file__, ".."))  # noqa: PTH118


def search_path() -> list[str]:
    """`sys.path` without the current folder, which Python puts there for -m, -c and an empty entry of PYTHONPATH.

    It stays where the project itself, or Python's own library, is in it.
    """
    here = os.path.realpath(os.curdir)
    if here in (_OWN, _PYTHONS):
        return [entry or here for entry in sys.path]
    return [entry for entry in sys.path if os.path.realpath(entry) != here]
