"""Runs of run-study that are watched and disturbed on their way, and what is left of them."""

import contextlib
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import pytest
import xarray as xr

from studyrunner import task_runs
from studyrunner.cli import main

FAKED = str(Path(__file__).with_name("run_faked.py"))
ROOT = Path(__file__).parents[2]

CHEAP = (
    *("two_masses", "--set", "axes.wear_coefficient=1e-11"),
    *("--set", "slow_time.cycles=20_000", "--set", "slow_time.outputs=21"),
)
"""A study for the stand-in, of the scene that is built fastest: most of what these tests take is the start of runs."""

PATIENCE = 240.0
"""Seconds after which something hangs, however busy the machine is; nothing that is right takes a tenth of that."""

SOON = 30.0
"""Seconds in which a run ends that is told to, on a machine with ten times the work that it has cores for; ranks that
wait for a lost one take 60 and more."""

_MARK = "FRETWEAR_TEST_RUN"
"""Variable in the environment of all processes of a run, those that its launcher has left behind included."""


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


def run_command(
    command: Sequence[str], folder: Path, environment: dict[str, str] | None = None
) -> subprocess.CompletedProcess[str]:
    """The command, ended, with all that it said; never hangs."""
    variables = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1", **(environment or {})}
    given = {"cwd": folder, "env": variables, "timeout": PATIENCE, "check": False}
    return subprocess.run(command, capture_output=True, text=True, errors="replace", **given)


@contextlib.contextmanager
def mounted(folder: Path, options: str) -> Iterator[Path]:
    """A file system in memory on a new folder; the test is skipped where none can be mounted."""
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(folder)]
    if os.geteuid() != 0 or subprocess.run(mount, capture_output=True, check=False).returncode != 0:
        pytest.skip("a file system can be mounted by root only")
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


@dataclass(frozen=True)
class Ended:
    """How a run ended: exit status, what it said on stderr, seconds from the signal to the end of its last process."""

    status: int
    said: str
    seconds: float


class Running:
    """A run on its way."""

    def __init__(self, process: subprocess.Popen[bytes], stderr: IO[bytes], mark: str) -> None:
        self.process = process
        self._stderr = stderr
        self._mark = f"{_MARK}={mark}".encode()

    @property
    def said(self) -> str:
        """Its stderr so far."""
        size = os.fstat(self._stderr.fileno()).st_size
        return os.pread(self._stderr.fileno(), size, 0).decode("utf-8", "replace")

    def reaches(self, condition: Callable[[], bool]) -> bool:
        """Waits until the condition holds; False where the run ends before. Fails where neither happens."""
        latest = time.monotonic() + PATIENCE
        while not condition():
            if self.process.poll() is not None:
                return condition()
            assert time.monotonic() < latest, f"it hangs: {self.said}"
            time.sleep(2e-3)
        return True

    def processes(self) -> dict[int, dict[bytes, bytes]]:
        """Its processes that are alive, the one that was started included, with their environments."""
        found = {}
        for path in Path("/proc").glob("[0-9]*/environ"):
            with contextlib.suppress(OSError):  # one that has ended
                variables = path.read_bytes().split(b"\0")
                if self._mark in variables:
                    found[int(path.parent.name)] = dict(each.split(b"=", 1) for each in variables if b"=" in each)
        return found

    def shared_memory(self) -> dict[str, bool]:
        """Memory that MPICH shares between the ranks, and whether it still has a name, which a kill would leave."""
        lines = [line for pid in self.ranks().values() for line in Path(f"/proc/{pid}/maps").read_text().splitlines()]
        names = {line[line.index("/dev/shm/") :] for line in lines if "/dev/shm/mpich_shm_" in line}
        return {name: Path(name).exists() for name in names}

    def ranks(self) -> dict[int, int]:
        """The processes that compute, by their number: run-study alone, or those that the launcher has given one."""
        numbers = {pid: variables.get(b"PMI_RANK") for pid, variables in self.processes().items()}
        return {int(number): pid for pid, number in numbers.items() if number is not None} or {0: self.process.pid}


def run_to_end(
    n_ranks: int,
    arguments: Sequence[str],
    folder: Path,
    environment: dict[str, str] | None = None,
    disturb: Callable[[Running], object] = lambda _: None,
) -> Ended:
    """Runs under mpiexec, or alone for 0 ranks, with `disturb` called once it has started; never hangs.

    Fails where a process outlives the run.
    """
    command = [*launcher(n_ranks), sys.executable, *arguments]
    mark = uuid.uuid4().hex
    with (
        tempfile.TemporaryFile() as stderr,
        subprocess.Popen(
            command,
            cwd=folder,
            env={**os.environ, "PYTHONPATH": str(ROOT), **(environment or {}), _MARK: mark},
            stdout=subprocess.DEVNULL,
            stderr=stderr,
        ) as process,
    ):
        running = Running(process, stderr, mark)
        try:
            disturb(running)
            began = time.monotonic()
            status = process.wait(PATIENCE)
            while running.processes():
                assert time.monotonic() < began + PATIENCE, "processes outlive their run"
                time.sleep(0.01)
            seconds = time.monotonic() - began
        finally:
            for pid in running.processes():
                with contextlib.suppress(ProcessLookupError):
                    os.kill(pid, signal.SIGKILL)
        return Ended(status, running.said, seconds)


def run_here(arguments: Sequence[str], folder: Path) -> xr.Dataset:
    """The result of a run in this process, which has loaded everything already."""
    with contextlib.chdir(folder):
        assert main([*arguments, "-o", "out.nc"]) in (0, 3)
        return results()


def fake_here(arguments: Sequence[str], folder: Path, environment: dict[str, str] | None = None) -> int:
    """Exit status of a run with the stand-in for the solver, in this process. arguments: FAKED first, as elsewhere."""
    from tests.mpi.run_faked import compute_fake

    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr(task_runs, "compute_task", compute_fake)
        for name, value in (environment or {}).items():
            patch.setenv(name, value)
        return main(arguments[1:])


def results(path: Path | str = "out.nc") -> xr.Dataset:
    """A result file without what depends on the machine."""
    with xr.open_dataset(path) as opened:
        return opened.load().drop_vars("run_time")


def count_entries(kind: str, result: Path = Path("out.nc")) -> int:
    """Number of entries of a kind in the progress of a result, also of a run that is at work."""
    address = f"file:{result}.progress?mode=ro&immutable=1"
    with contextlib.suppress(sqlite3.Error), contextlib.closing(sqlite3.connect(address, uri=True)) as database:
        (number,) = database.execute("SELECT count(*) FROM entries WHERE kind=?", [kind]).fetchone()
        return int(number)
    return 0
