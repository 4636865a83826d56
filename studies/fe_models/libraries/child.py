"""The process in which a library reads a foreign file, see `libraries.process`."""

from __future__ import annotations

import json
import os
import resource
from pathlib import Path
from typing import NoReturn

import numpy as np

from studies.fe_models.libraries.process import REFUSED, seconds_for
from studies.scene_error import SceneError

_LEAST_MEMORY = 4 * 2**30  # bytes of address space; the libraries alone take one or two GiB of it
_MEMORY_PER_BYTE = 20


def _limit(size: int) -> None:
    """Limits this process to what a file of this size may take."""
    memory = _LEAST_MEMORY + _MEMORY_PER_BYTE * size
    for what, limit in (
        (resource.RLIMIT_AS, memory),
        (resource.RLIMIT_CPU, seconds_for(size)),
        (resource.RLIMIT_FSIZE, memory),
        (resource.RLIMIT_CORE, 0),
    ):
        _, most = resource.getrlimit(what)
        resource.setrlimit(what, (limit if most == resource.RLIM_INFINITY else min(limit, most), most))


def main(arguments: list[str]) -> NoReturn:
    """The process that reads. arguments: kind of file, path, and where the arrays go."""
    kind, path, answer = arguments[0], Path(arguments[1]), Path(arguments[2])
    if kind == "gmsh":
        from studies.fe_models.libraries.gmsh import read_arrays
    elif kind == "cdb":
        from studies.fe_models.libraries.cdb import read_arrays
    else:
        from studies.fe_models.libraries.full import read_arrays
    _limit(path.stat().st_size)
    try:
        arrays = read_arrays(path)
        np.savez(answer, allow_pickle=False, **arrays)
    except SceneError as error:
        print(f"\n{json.dumps([error.value, error.remedy])}", end="", flush=True)
        os._exit(REFUSED)
    except ImportError as error:
        found = f"the library that reads {path.name} does not load: {error}"
        print(f"\n{json.dumps([found, 'install it again, with what it needs'])}", end="", flush=True)
        os._exit(REFUSED)
    # the libraries raise anything for a damaged file, and some of them end the process; the status says it all
    except (Exception, SystemExit):
        os._exit(1)
    os._exit(0)
