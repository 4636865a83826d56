"""The process in which a library reads a foreign file, see `libraries.process`."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import NoReturn

import numpy as np

from studies.fe_models.libraries.process import seconds_for
from studies.guards.limited_process import REFUSED, limit_this_process
from studies.scene_error import SceneError

_LEAST_MEMORY = 4 * 2**30  # bytes of address space; the libraries alone take one or two GiB of it
_MEMORY_PER_BYTE = 20


def main(arguments: list[str]) -> NoReturn:
    """The process that reads. arguments: kind of file, path, and where the arrays go."""
    kind, path, answer = arguments[0], Path(arguments[1]), Path(arguments[2])
    if kind == "gmsh":
        from studies.fe_models.libraries.gmsh import read_arrays
    elif kind == "cdb":
        from studies.fe_models.libraries.cdb import read_arrays
    else:
        from studies.fe_models.libraries.full import read_arrays
    size = path.stat().st_size
    limit_this_process(_LEAST_MEMORY + _MEMORY_PER_BYTE * size, seconds_for(size))
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
