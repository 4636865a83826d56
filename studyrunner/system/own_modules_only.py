"""The first import of the commands: from here on no module is taken from the current folder.

By hand: the options -P and -I of Python cannot be given to an installed command.
"""

from __future__ import annotations

import os
import sys

# The rule itself has to come from beside this package, and not from a folder `studies` in the current one.
sys.path.insert(0, os.path.realpath(os.path.join(__file__, "..", "..", "..")))  # noqa: PTH118

from studies.guards.search_path import search_path

del sys.path[0]
sys.path[:] = search_path()

# Nor does numba keep what it compiles, which it loads as code, where a file .numba_config.yaml in that folder says.
os.environ.setdefault("NUMBA_CACHE_DIR", "")
