"""Processes with limits of time and memory, for reading files of unknown origin.

Such a process may crash, never end, or exceed its memory: its exit status is the answer. Modules are searched where
this process searches them, but never in the current folder.
"""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

from studies.guards.search_path import search_path

REFUSED = 3
"""Exit status of a process that says what is wrong with a file."""

_START = """\
import json, sys
sys.path[:] = json.loads(sys.argv[1])
from importlib import import_module
import_module(sys.argv[2]).main(sys.argv[3:])"""


def run_limited(module: str, arguments: Sequence[str], seconds: float) -> tuple[int, str]:
    """Exit status of a process, -1 where it takes longer than so many seconds, and what it writes.

    The process calls `main(arguments)` of a module, which ends it, and sets its limits with `limit_this_process` once
    it has loaded what it needs.
    """
    # one thread: the memory that others set aside counts, too
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    # isolated: neither the current folder nor the environment says where its modules are, but for this list
    path = [str(Path(__file__).parents[2]), *search_path()]
    command = [sys.executable, "-I", "-c", _START, json.dumps(path), module, *arguments]
    try:
        done = subprocess.run(
            command,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=seconds,
            check=False,
        )
    except subprocess.TimeoutExpired:
        return -1, ""
    return done.returncode, done.stdout.decode(errors="replace")


def limit_this_process(memory: int, seconds: int) -> None:
    """Limits of this process: bytes of address space and of a file that it writes, and CPU seconds from its start."""
    for what, limit in (
        (resource.RLIMIT_AS, memory),
        (resource.RLIMIT_CPU, seconds),
        (resource.RLIMIT_FSIZE, memory),
        (resource.RLIMIT_CORE, 0),
    ):
        _, most = resource.getrlimit(what)
        resource.setrlimit(what, (limit if most == resource.RLIM_INFINITY else min(limit, most), most))
