"""Hash of what computes: the source of a package of ours, and the versions of the packages that all of them use.

By hand: the hashes in the metadata of a package are missing where the package is installed in editable form.
"""

from __future__ import annotations

import hashlib
import json
import platform
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

_COMPUTING = ("fretwear", "numba", "numpy", "scipy")


def package_digest(package: str) -> str:
    """Hash of all source files of a package, with their paths, and of the versions. Raises ModuleNotFoundError."""
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
