"""Runs of run-study that are killed on their way, and what is left of them."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
import xarray as xr

FAKED = str(Path(__file__).with_name("run_faked.py"))
ROOT = Path(__file__).parents[2]


def mpiexec() -> str:
    """The launcher of the environment that the tests run in; the one on the path where it has none."""
    own = Path(sys.executable).with_name("mpiexec")
    found = str(own) if own.exists() else shutil.which("mpiexec")
    if found is None:
        pytest.fail("the tests need the extra mpi: there is no mpiexec")
    return found


def launcher(n_ranks: int) -> list[str]:
    """What stands before the command: nothing for 0 ranks."""
    return [mpiexec(), "-n", str(n_ranks)] if n_ranks else []


@dataclass(frozen=True)
class Ended:
    """How a run ended: exit status, what it said on stderr, seconds from the signal to the end of its last process."""

    status: int
    said: str
    seconds: float


def run_to_end(
    n_ranks: int,
    arguments: list[str],
    folder: Path,
    environment: dict[str, str] | None = None,
    disturb: Callable[[subprocess.Popen[str]], None] = lambda _: None,
) -> Ended:
    """Runs under mpiexec, or alone for 0 ranks, with `disturb` called once it has started; never hangs.

    Fails where a process outlives the run.
    """
    with subprocess.Popen(
        [*launcher(n_ranks), sys.executable, *arguments],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(ROOT), **(environment or {})},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        # tests that run in the background ignore the interrupt, and what they start would, too
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:
        others: set[int] = set()
        try:
            disturb(process)
            others = processes_of(process.pid)
            began = time.monotonic()
            _, said = process.communicate(timeout=60)
            while any(map(is_alive, others)):
                assert time.monotonic() < began + 60, "processes outlive their run"
                time.sleep(0.01)
        finally:
            for pid in (process.pid, *others):
                if is_alive(pid):
                    os.kill(pid, signal.SIGKILL)
    return Ended(process.returncode, said, time.monotonic() - began)


def processes_of(launched: int) -> set[int]:
    """All processes that a process has started, directly or not."""
    children: dict[int, list[int]] = {}
    for path in Path("/proc").iterdir():
        if path.name.isdecimal() and (fields := _status(int(path.name))):
            children.setdefault(int(fields[1]), []).append(int(path.name))
    found: set[int] = set()
    left = [launched]
    while left:
        new = children.get(left.pop(), [])
        found.update(new)
        left.extend(new)
    return found


def ranks_of(launched: int) -> list[int]:
    """Those that compute: run-study alone, or all that the launcher has started but its own helpers."""
    found = [pid for pid in sorted(processes_of(launched)) if b"hydra" not in _command(pid)]
    return found or [launched]


def is_alive(pid: int) -> bool:
    """Whether there is such a process that has not ended."""
    return bool(fields := _status(pid)) and fields[0] != "Z"


def results(path: Path) -> xr.Dataset:
    """A result file without what depends on the machine."""
    with xr.open_dataset(path) as opened:
        return opened.load().drop_vars("run_time")


def _status(pid: int) -> list[str]:
    try:
        return Path(f"/proc/{pid}/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
    except OSError:
        return []


def _command(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""
