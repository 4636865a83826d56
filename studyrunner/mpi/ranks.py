"""The ranks of a run: processes that a launcher has started together, or one process alone.

Only this module imports mpi4py, and only where a launcher is at work: `run-study` alone needs no MPI library. All MPI
calls come from the main thread, so that any MPI library works (MPI_THREAD_FUNNELED). The loss of a rank ends all.
"""

import contextlib
import os
import platform
import sys
import time
import warnings
from collections.abc import Mapping
from pathlib import Path

from studyrunner.system.machine import package_digest
from studyrunner.system.process import die, leave_endings, uninterrupted

POLL_SECONDS = 1e-3  # between two looks for a message: a blocking receive would keep a core busy

_SIZES = ("PMI_SIZE", "OMPI_COMM_WORLD_SIZE", "MV2_COMM_WORLD_SIZE", "SLURM_STEP_NUM_TASKS")
_RANKS = ("PMI_RANK", "OMPI_COMM_WORLD_RANK", "MV2_COMM_WORLD_RANK", "PMIX_RANK", "SLURM_PROCID")
_JOBS = ("SLURM_NTASKS", "PBS_NP", "LSB_DJOB_NUMPROC", "NSLOTS")
_SIGNS = (*_SIZES, *_RANKS[:-1], "PMI_FD", "PMI_CONTROL_PORT", "PALS_RANKID")
_SECONDS_TO_PRINT = 1.0
_SHARED = "/dev/shm/mpich_shm_"
_SECONDS_TO_MAP = 600.0
_MANY_SENT = 64
_REMEDY = "start run-study with the mpiexec of its environment or, on a cluster, install mpi4py against the site's MPI"


class LauncherError(Exception):
    """The launcher started processes that cannot work together: each would compute the whole study.

    known: whether all of them know; otherwise some may wait for this one.
    """

    def __init__(self, message: str, *, known: bool = True) -> None:
        super().__init__(message)
        self.known = known


def launcher_rank(environment: Mapping[str, str] = os.environ) -> int:
    """Number of this process according to the launcher, 0 without launcher."""
    return _largest(environment, _RANKS)


def launcher_size(environment: Mapping[str, str] = os.environ) -> int:
    """Number of processes according to the launcher, 0 without launcher."""
    return _largest(environment, _SIZES)


def job_size(environment: Mapping[str, str] = os.environ) -> int:
    """Number of processes that a batch system has room for, without launcher; 0 if unknown."""
    return 0 if launcher_size(environment) else _largest(environment, _JOBS)


def _largest(environment: Mapping[str, str], names: tuple[str, ...]) -> int:
    texts = (environment.get(name, "") for name in names)
    return max((int(text) for text in texts if text.isdecimal()), default=0)


class Ranks:
    """Processes that send each other Python objects, in the order of sending; this class: one process, without MPI.

    rank: of this process; process 0 hands out the work. size: number of processes.
    """

    rank = 0
    size = 1

    def send(self, message: object, rank: int) -> None:
        """Sends without waiting for the receiver."""

    def flush(self) -> None:
        """Waits until all messages are received: a large one moves only while its sender is in the MPI library."""

    def receive(self) -> tuple[int, object] | None:
        """Sender and content of the next message, or None where there is none yet."""
        return None

    def close(self) -> None:
        """Ends the communication; every rank calls this once."""

    def abort(self, status: int) -> None:  # noqa: ARG002
        """Ends all ranks at once; returns only where there is no other rank."""
        if launcher_size() > 1:
            # they wait in MPI_Init
            time.sleep(_SECONDS_TO_PRINT)
            die()


class MpiRanks(Ranks):
    """All ranks of MPI's world. Raises ImportError or RuntimeError where mpi4py or an MPI library is missing.

    software: of each rank, as `describe_software` gives it.
    """

    def __init__(self) -> None:
        import mpi4py

        # Started and ended here rather than by the import: the launcher is compared with the library before.
        mpi4py.rc(initialize=False, finalize=False)
        from mpi4py import MPI

        library = MPI.get_vendor()[0]
        if "OMPI_COMM_WORLD_SIZE" in os.environ and library != "Open MPI":
            raise LauncherError(f"the launcher is that of Open MPI, the library is {library}")
        with warnings.catch_warnings():
            # start_ranks says the same with the remedy.
            warnings.filterwarnings("ignore", "suspicious MPI execution environment", RuntimeWarning)
            # it waits for all ranks, deaf; UCX has taken SIGHUP meanwhile
            leave_endings()
            MPI.Init_thread(MPI.THREAD_FUNNELED)
        self._mpi, self._world = MPI, MPI.COMM_WORLD
        self._sent: list[MPI.Request] = []
        self._many = _MANY_SENT
        self.rank, self.size = self._world.Get_rank(), self._world.Get_size()
        self.software: list[tuple[str, str]] = self._world.allgather(describe_software())
        if library == "MPICH":
            # all ranks have mapped the memory: they have exchanged messages
            _unlink_shared_memory()

    def send(self, message: object, rank: int) -> None:  # noqa: D102
        if len(self._sent) >= self._many:
            # Not at every message: with thousands of ranks as many may be on their way.
            self._forget_sent()
            self._many = max(_MANY_SENT, 2 * len(self._sent))
        with uninterrupted():
            # the request holds the memory that the message is sent from
            self._sent.append(self._world.isend(message, dest=rank))

    def flush(self) -> None:  # noqa: D102
        while self._forget_sent():
            time.sleep(POLL_SECONDS)

    def receive(self) -> tuple[int, object] | None:  # noqa: D102
        with uninterrupted():
            status = self._mpi.Status()
            # The matched probe takes the message out at once: a receive after it gets this one and no other.
            matched = self._world.improbe(self._mpi.ANY_SOURCE, status=status)
            return None if matched is None else (status.Get_source(), matched.recv())

    def close(self) -> None:  # noqa: D102
        self.flush()
        self._mpi.Finalize()

    def abort(self, status: int) -> None:  # noqa: D102
        # The launcher passes on what a rank prints; what it has not passed on when it ends all is lost.
        sys.stderr.flush()
        time.sleep(_SECONDS_TO_PRINT)
        self._world.Abort(status)

    def _forget_sent(self) -> bool:
        """Whether there are messages that are still on their way."""
        self._sent = [request for request in self._sent if not request.Test()]
        return bool(self._sent)


def _unlink_shared_memory() -> None:
    """Removes the names of the memory that MPICH shares: the memory then ends with its processes, however they end.

    So it does with memory of this user that no process has mapped: ranks that were killed while they found each other
    have left it. A name is needed for the moment in which processes map it, and an old one by nobody.
    """
    for name in _mapped(Path("/proc/self/maps")):
        Path(name).unlink(missing_ok=True)
    # another rank may do the same
    with contextlib.suppress(OSError):
        old = {
            str(path)
            for path in Path(_SHARED).parent.glob(f"{Path(_SHARED).name}*")
            if (found := path.stat()).st_uid == os.geteuid() and found.st_mtime < time.time() - _SECONDS_TO_MAP
        }
        for name in old and old.difference(*map(_mapped, Path("/proc").glob("[0-9]*/maps"))):
            Path(name).unlink(missing_ok=True)


def _mapped(maps: Path) -> set[str]:
    """Names of such memory that a process has mapped; none where there is no such list, or it may not be read."""
    with contextlib.suppress(OSError):
        lines = maps.read_text(encoding="utf-8", errors="replace").splitlines()
        return {line[line.index(_SHARED) :] for line in lines if _SHARED in line}
    return set()


def start_ranks() -> Ranks:
    """The ranks that the launcher started, or this process alone without launcher. Raises LauncherError where MPI
    knows of fewer processes, or one of them runs other software.
    """
    if not any(name in os.environ for name in _SIGNS):
        return Ranks()
    announced = launcher_size()
    try:
        ranks = MpiRanks()
    except (ImportError, RuntimeError, LauncherError) as error:
        if announced <= 1:
            return Ranks()
        wrong = f"{announced} processes were started that cannot talk ({error}): {_REMEDY}"
        raise LauncherError(wrong, known=isinstance(error, LauncherError)) from error
    hosts = {software: host for host, software in ranks.software}
    if announced > ranks.size:
        wrong = f"{announced} processes were started, but MPI knows of {ranks.size} only: {_REMEDY}"
    elif len(hosts) > 1:
        versions = "different versions of this program, of Python or of numpy"
        wrong = f"ranks on {' and '.join(hosts.values())} run {versions}: install the same software for all ranks"
    else:
        return ranks
    ranks.close()
    raise LauncherError(wrong)


def describe_software() -> tuple[str, str]:
    """Name of this machine, and a hash of what this process runs."""
    packages = map(package_digest, ("solver", "studies", "studyrunner"))
    return platform.node(), " ".join((platform.machine(), *packages))
