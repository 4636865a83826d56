"""Many cases: study files, tasks on MPI ranks, result files and the command line.

For use in Python, from this package itself:

- `read_study`: a checked `Study` from a file or by the name of a bundled one;
- `run_study`: runs it in this process and gives its result as an `xarray.Dataset`;
- `open_result`: that of a result file, with the accessor `fretwear`;
- `compute_worn_joint`: response curve, loops and natural frequencies of a worn joint, from the wear depths of a result;
- `UserError`, `StorageError`: what they raise, in one sentence.

The rooms are in the map of CONTRIBUTING.md.
"""

import os
from importlib import import_module

# `typing` takes longer to load than the rest, and Ctrl-C meanwhile is a traceback: see `commands`
TYPE_CHECKING = False
if TYPE_CHECKING:
    from studyrunner.api import StorageError, Study, UserError, open_result, read_study, run_study
    from studyrunner.worn_joint import compute_worn_joint

__all__ = ["StorageError", "Study", "UserError", "compute_worn_joint", "open_result", "read_study", "run_study"]


# Before the libraries of HDF5 are loaded: they do without locks where the system has none, but refuse a file where the
# file system has none (ENOLCK, EOPNOTSUPP). Results need none: they are written under a name that no other run has, and
# renamed. A user who wants locks says so.
os.environ.setdefault("HDF5_USE_FILE_LOCKING", "FALSE")


# Loaded when first asked for: the commands import this package before numpy may be loaded.
def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{'worn_joint' if name == 'compute_worn_joint' else 'api'}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
