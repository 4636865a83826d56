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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

import pytest
import xarray as xr

from studyrunner.cli import main
from studyrunner.kinds.wear.histories import History, Sweep

FAKED = str(Path(__file__).with_name("run_faked.py"))
ROOT = Path(__file__).parents[2]


def options(*overrides: str) -> list[str]:
    return [part for text in overrides for part in ("--set", text)]


CHEAP = ("two_masses", *options("axes.wear_coefficient=1e-11", "slow_time.cycles=20_000", "slow_time.outputs=21"))
"""A study for the stand-in, of the scene that is built fastest: most of what these tests take is the start of runs."""

PATIENCE = 240.0
"""Seconds after which something hangs, however busy the machine is; nothing that is right takes a tenth of that."""

SOON = 30.0
"""Seconds in which a run ends after a signal, on a machine with ten times the work that it has cores for; ranks that
wait for a lost one take 60 and more."""

_MARK = "FRETWEAR_TEST_RUN"
"""Variable in the environment of all processes of a run, those that its launcher has left behind included."""


def launcher(n_ranks: int) -> list[str]:
    """What stands before the command, nothing for 0 ranks: mpiexec of the environment, or the one on the path."""
    own = Path(sys.executable).with_name("mpiexec")
    found = str(own) if own.exists() else shutil.which("mpiexec")
    if found is None:
        pytest.fail("the tests need the extra mpi: there is no mpiexec")
    return [found, "-n", str(n_ranks)] if n_ranks else []


@dataclass(frozen=True)
class Ended:
    """How a run ended: exit status, stdout and stderr, seconds from the signal to the end of its last process."""

    status: int
    out: str
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
        """What it has said on stderr so far."""
        return _text_of(self._stderr)

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

    def ranks(self) -> dict[int, int]:
        """The processes that compute, by their number: run-study alone, or those that the launcher has given one."""
        numbers = {pid: variables.get(b"PMI_RANK") for pid, variables in self.processes().items()}
        return {int(number): pid for pid, number in numbers.items() if number is not None} or {0: self.process.pid}


def run_command(command, folder, environment=None, disturb=lambda _: None) -> Ended:
    """A command to its end, with `disturb` called once it has started; never hangs.

    Fails where a process outlives the command.
    """
    mark = uuid.uuid4().hex
    surroundings = {**os.environ, "PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "1", _MARK: mark}
    surroundings |= environment or {}
    with (
        tempfile.TemporaryFile() as stdout,
        tempfile.TemporaryFile() as stderr,
        subprocess.Popen(command, cwd=folder, env=surroundings, stdout=stdout, stderr=stderr) as process,
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
        return Ended(status, _text_of(stdout), running.said, seconds)


def _text_of(file: IO[bytes]) -> str:
    return os.pread(file.fileno(), os.fstat(file.fileno()).st_size, 0).decode("utf-8", "replace")


def run_to_end(n_ranks: int, arguments: Sequence[str], *given: Any, **more: Any) -> Ended:
    """Python with these arguments under mpiexec, or alone for 0 ranks; given, more: as of `run_command`."""
    return run_command([*launcher(n_ranks), sys.executable, *arguments], *given, **more)


def run_here(arguments: Sequence[str], folder: Path, environment: Mapping[str, str] | None = None) -> int:
    """Exit status of a run in this process, which has loaded everything already; with the stand-in after FAKED."""
    from tests.mpi.run_faked import compute_fake

    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for name, value in (environment or {}).items():
            patch.setenv(name, value)
        if arguments[0] == FAKED:
            for kind in (Sweep, History):
                patch.setattr(kind, "compute", compute_fake)
            arguments = arguments[1:]
        return main(list(arguments))


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
