"""The launcher that started this process, from variables of the environment, without MPI.

By hand: under the launcher of another library mpi4py starts as a world of one process, and says nothing.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import sys
from collections.abc import Mapping
from importlib import metadata

_SIZES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "MV2_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS")
_RANKS = ("PMI_RANK", "OMPI_COMM_WORLD_RANK", "MV2_COMM_WORLD_RANK", "PMIX_RANK", "SLURM_PROCID")
_JOBS = ("SLURM_NTASKS", "PBS_NP", "LSB_DJOB_NUMPROC", "NSLOTS")
_SIGNS = (*_SIZES, *_RANKS[:-1], "PMI_FD", "PMI_CONTROL_PORT", "PALS_RANKID")
_PACKAGED_LIBRARIES = (
    *("libucm.so.0", "libucs.so.0", "libuct.so.0", "libucp.so.0", "libfabric.so.1"),
    "libmpi.so.12",
)
"""Files of the package mpich, each after those that it depends on."""


class LauncherError(Exception):
    """The launcher started several processes that cannot exchange messages: each would compute the whole study."""


def has_launcher(environment: Mapping[str, str] = os.environ) -> bool:
    """Whether a launcher is at work, for one process or several."""
    return any(name in environment for name in _SIGNS)


def launcher_rank(environment: Mapping[str, str] = os.environ) -> int:
    """Number of this process according to the launcher, 0 without launcher."""
    return max(_count(environment, name) for name in _RANKS)


def launcher_size(environment: Mapping[str, str] = os.environ) -> int:
    """Number of processes according to the launcher, 0 without launcher."""
    return max(_count(environment, name) for name in _SIZES)


def job_size(environment: Mapping[str, str] = os.environ) -> int:
    """Number of processes that a batch system has room for, without launcher; 0 if unknown."""
    return 0 if launcher_size(environment) else max(_count(environment, name) for name in _JOBS)


def _count(environment: Mapping[str, str], name: str) -> int:
    text = environment.get(name, "")
    return int(text) if text.isdecimal() else 0


def load_packaged_library() -> None:
    """Loads the MPI library that is installed as a Python package, where there is one, with what it depends on.

    mpi4py looks for that library first. Its own dependencies, however, are searched in LD_LIBRARY_PATH first, which may
    lead to those of another MPI on the machine; loaded from their places before, they are taken from there.
    """
    if "MPI4PY_LIBMPI" in os.environ or sys.platform != "linux":
        return
    try:
        files = metadata.files("mpich") or []
    except metadata.PackageNotFoundError:
        return
    for name in _PACKAGED_LIBRARIES:
        for file in files:
            if file.name == name:
                # Where this fails, mpi4py looks for a library on its own, and says so where it finds none.
                with contextlib.suppress(OSError):
                    ctypes.CDLL(str(file.locate()), mode=os.RTLD_LAZY | os.RTLD_LOCAL)
