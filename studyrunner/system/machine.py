"""The machine and its software: a hash of what computes, and faults that say nothing of the point that was computed."""

from __future__ import annotations

import builtins
import hashlib
import json
import platform
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

_COMPUTING = ("fretwear", "numba", "numpy", "scipy")

_FAULTS = (OSError, EOFError, ImportError)
# the last one by its name: what numba raises where its cache is cut off
_NAMES = frozenset(
    kind.__name__ for kind in vars(builtins).values() if isinstance(kind, type) and issubclass(kind, _FAULTS)
) | {"UnpicklingError"}


class MachineFaultError(Exception):
    """A disk or the cache of the kernels is at fault, and not the task that broke off: the run ends with one line."""


def is_machine_fault(message: str) -> bool:
    """Whether a line of `describe_error` tells of such a fault."""
    return message.partition(":")[0] in _NAMES


def package_digest(package: str) -> str:
    """Hash of all source files of a package, with their paths, and of the versions. Raises ModuleNotFoundError.

    By hand: the hashes in the metadata of a package are missing where the package is installed in editable form.
    """
    specification = find_spec(package)
    if specification is None or not specification.submodule_search_locations:
        raise ModuleNotFoundError(f"the package {package} is not installed")
    folder = Path(next(iter(specification.submodule_search_locations)))
    versions = [platform.python_version(), *(metadata.version(name) for name in _COMPUTING)]
    hashes = [
        (path.relative_to(folder).as_posix(), hashlib.sha256(path.read_bytes()).hexdigest())
        for path in sorted(folder.rglob("*.py"))
    ]
    return hashlib.sha256(json.dumps((versions, hashes)).encode()).hexdigest()[:32]
