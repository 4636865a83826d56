"""The ranks of a run: processes that a launcher has started together, or one process alone.

Only this module imports mpi4py, and only where a launcher is at work: `run-study` alone needs no MPI library. All MPI
calls come from the main thread, so that any MPI library works (MPI_THREAD_FUNNELED).

By hand: mpi4py needs an MPI library, and leaves lost ranks and signals to its user.
"""

from __future__ import annotations

import contextlib
import faulthandler
import os
import signal
import sys
import time
import warnings
from importlib import metadata
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, NoReturn, Protocol

from studyrunner.mpi.launcher import LauncherError, has_launcher, launcher_rank, launcher_size, load_packaged_library
from studyrunner.system.endings import uninterrupted

if TYPE_CHECKING:
    from mpi4py import MPI

POLL_SECONDS = 1e-3
"""Time between two looks for a message, s. A blocking receive would keep a core busy."""

_SECONDS_TO_PRINT = 1.0
_SHARED = "/dev/shm/mpich_shm_"
_MANY_SENT = 64

_TOLERANT = "OMPI_MCA_mpi_ft_enable"
"""Variable that the launcher of Open MPI sets with --with-ft ulfm."""

_SECONDS_TO_START = 120.0
"""Longest time from the first rank that calls the library to the last, s. Ranks of a job start within seconds."""

_SECONDS_TO_MISS_RANK_0 = 0.5

_REMEDY = (
    "start run-study with the mpiexec of the environment it is installed in or, on a cluster, install mpi4py against"
    " the site's MPI"
)


class Ranks(Protocol):
    """Processes that send each other Python objects. Messages between two ranks arrive in the order of sending."""

    @property
    def rank(self) -> int:
        """Number of this process; process 0 hands out the work."""

    @property
    def size(self) -> int:
        """Number of processes, lost ones included."""

    @property
    def lost(self) -> frozenset[int]:
        """Processes that have ended before their time, as far as known here; empty where the loss of one ends all."""

    def send(self, message: object, rank: int) -> None:
        """Sends without waiting for the receiver."""

    def flush(self) -> None:
        """Waits until all messages are received, or need this process no more; called before a rank goes on computing.

        The receiver has to look for messages: a large message moves only while its sender is in the MPI library.
        """

    def receive(self, rank: int | None = None) -> tuple[int, object] | None:
        """Sender and content of the next message, or None where there is none yet.

        rank: sender; messages of other senders stay where they are. None for any sender.
        """

    def close(self) -> None:
        """Ends the communication; every rank calls this once."""

    def abort(self, status: int) -> None:
        """Ends all ranks at once; returns only where there is no other rank."""


class Alone:
    """A run of one process, without MPI."""

    rank = 0
    size = 1
    lost: frozenset[int] = frozenset()

    def send(self, message: object, rank: int) -> None:
        """There is no receiver: a call is a bug."""
        raise ValueError(f"no rank {rank} for {message!r} in a run of one process")

    def flush(self) -> None:
        """Does nothing."""

    def receive(self, rank: int | None = None) -> tuple[int, object] | None:  # noqa: ARG002 - as in Ranks
        """There is no sender."""
        return None

    def close(self) -> None:
        """Does nothing."""

    def abort(self, status: int) -> None:
        """Does nothing."""


class MpiRanks:
    """All ranks of MPI's world. Raises ImportError or RuntimeError where mpi4py or an MPI library is missing."""

    lost: frozenset[int] = frozenset()

    def __init__(self) -> None:
        import mpi4py

        load_packaged_library()
        # Started and ended here rather than by the import: the launcher is compared with the library before.
        mpi4py.rc(initialize=False, finalize=False)
        from mpi4py import MPI

        library = MPI.get_vendor()[0]
        if "OMPI_COMM_WORLD_SIZE" in os.environ and library != "Open MPI":
            raise LauncherError(f"the launcher is that of Open MPI, the library is {library}")
        with warnings.catch_warnings():
            # start_ranks says the same with the remedy.
            warnings.filterwarnings("ignore", "suspicious MPI execution environment", RuntimeWarning)
            MPI.Init_thread(MPI.THREAD_FUNNELED)
        self._mpi = MPI
        self._world = MPI.COMM_WORLD
        self._sent: list[MPI.Request] = []
        self._many = _MANY_SENT
        self.rank: int = self._world.Get_rank()
        self.size: int = self._world.Get_size()
        if library == "MPICH":
            # behind the barrier all ranks have mapped the memory
            self._world.Barrier()
            _unlink_shared_memory()

    def send(self, message: object, rank: int) -> None:
        """As in Ranks."""
        if len(self._sent) >= self._many:
            # Not at every message: with thousands of ranks as many may be on their way.
            self._forget_sent()
            self._many = max(_MANY_SENT, 2 * len(self._sent))
        with uninterrupted():
            # the request holds the memory that the message is sent from
            self._sent.append(self._world.isend(message, dest=rank))

    def flush(self) -> None:
        """As in Ranks."""
        self._forget_sent()
        while self._sent:
            time.sleep(POLL_SECONDS)
            self._forget_sent()

    def receive(self, rank: int | None = None) -> tuple[int, object] | None:
        """As in Ranks."""
        with uninterrupted():
            status = self._mpi.Status()
            source = self._mpi.ANY_SOURCE if rank is None else rank
            # The matched probe takes the message out at once: a receive after it gets this one and no other.
            matched = self._world.improbe(source, status=status)
            return None if matched is None else (status.Get_source(), matched.recv())

    def close(self) -> None:
        """As in Ranks."""
        self.flush()
        self._mpi.Finalize()

    def abort(self, status: int) -> None:
        """As in Ranks."""
        # The launcher passes on what a rank prints; what it has not passed on when it is told to end all is lost.
        sys.stderr.flush()
        time.sleep(_SECONDS_TO_PRINT)
        self._world.Abort(status)

    def _forget_sent(self) -> None:
        self._sent = [request for request in self._sent if not self._is_through(request)]

    def _is_through(self, request: MPI.Request) -> bool:
        return request.Test()


def _unlink_shared_memory() -> None:
    """Removes the names of the memory that MPICH shares: the memory then ends with its processes, however they end."""
    # systems other than Linux have no such list; another rank may be faster, and a name that stays is no harm
    with contextlib.suppress(OSError):
        for line in Path("/proc/self/maps").read_text(encoding="utf-8", errors="replace").splitlines():
            if _SHARED in line:
                with contextlib.suppress(OSError):
                    Path(line[line.index(_SHARED) :]).unlink()


class TolerantRanks(MpiRanks):
    """MPI ranks where the end of one process does not end all: Open MPI 5 under `mpiexec --with-ft ulfm`.

    MPI reports a lost process when it is asked for messages (ULFM, MPI 5). Messages to lost processes are dropped.
    Without rank 0 the other ranks end.
    """

    def __init__(self) -> None:
        # The library waits for ever for a process that is lost while it starts, and lets no other thread run.
        speaks = launcher_rank() == 0
        patience = _SECONDS_TO_START if speaks else _SECONDS_TO_START + 2.0 * _SECONDS_TO_PRINT
        with Path(os.devnull).open("w", encoding="utf-8") as nobody:
            faulthandler.dump_traceback_later(patience, exit=True, file=2 if speaks else nobody)
            try:
                super().__init__()
            finally:
                faulthandler.cancel_dump_traceback_later()
        if self.rank > 0:
            # In the midst of a long task as well, and in the main thread, as all calls of MPI.
            signal.signal(signal.SIGALRM, self._look_after_rank_0)
            signal.siginterrupt(signal.SIGALRM, False)
            signal.setitimer(signal.ITIMER_REAL, _SECONDS_TO_MISS_RANK_0, _SECONDS_TO_MISS_RANK_0)

    def send(self, message: object, rank: int) -> None:
        """As in Ranks; a message to a lost process is dropped."""
        if rank not in self.lost:
            try:
                super().send(message, rank)
            except self._mpi.Exception as error:
                self._note_lost(error)

    def receive(self, rank: int | None = None) -> tuple[int, object] | None:
        """As in Ranks."""
        try:
            return super().receive(rank)
        except self._mpi.Exception as error:
            self._note_lost(error)
            return None

    def close(self) -> None:
        """As in Ranks."""
        # Rank 0 may still write the result. The launcher has no status for its loss, if the others are gone by then.
        if self.rank == 0:
            for rank in range(1, self.size):
                self.send(None, rank)
        else:
            wait_for_message(self)
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        # MPI_Finalize sometimes waits for ever where a process is lost, of which not all need know. The launcher takes
        # the exit status from processes that end without it as well.
        self.flush()

    def _is_through(self, request: MPI.Request) -> bool:
        try:
            return request.Test()
        except self._mpi.Exception as error:
            self._note_lost(error)
            return True

    def _look_after_rank_0(self, _number: int, _frame: FrameType | None) -> None:
        try:
            self._world.iprobe()
        except self._mpi.Exception as error:
            self._note_lost(error)

    def _note_lost(self, error: MPI.Exception) -> None:
        """Notes the lost processes that an error names. Raises any other error."""
        if error.Get_error_class() not in (self._mpi.ERR_PROC_FAILED, self._mpi.ERR_PROC_FAILED_PENDING):
            raise error
        failed = self._world.Get_failed()
        # Until then every look for a message tells of them again.
        self._world.Ack_failed(failed.Get_size())
        numbers = range(failed.Get_size())
        self.lost |= set(self._mpi.Group.Translate_ranks(failed, numbers, self._world.Get_group()))
        if 0 in self.lost:
            self._end_without_rank_0()

    def _end_without_rank_0(self) -> NoReturn:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        if any(rank not in self.lost for rank in range(self.rank)):
            # One speaks for all; the launcher passes nothing on once another one has ended.
            time.sleep(2.0 * _SECONDS_TO_MISS_RANK_0)
        else:
            line = (
                "run-study: rank 0 is lost, which the others cannot do without: the same command goes on where it was"
            )
            print(line, file=sys.stderr, flush=True)
        # Each by itself: MPI_Abort leaves processes behind here, and its status is not always that of the launcher.
        os._exit(1)


def start_ranks() -> Ranks:
    """The ranks that the launcher started, or this process alone where there is no launcher.

    Raises
    ------
    LauncherError
        Where the launcher started more processes than the MPI library knows of.
    """
    if not has_launcher():
        return Alone()
    announced = launcher_size()
    try:
        ranks = TolerantRanks() if _survives_losses() else MpiRanks()
    except (ImportError, RuntimeError, LauncherError) as error:
        if announced <= 1:
            return Alone()
        raise LauncherError(f"{announced} processes were started that cannot talk ({error}): {_REMEDY}") from error
    if announced > ranks.size:
        ranks.close()
        raise LauncherError(f"{announced} processes were started, but MPI knows of {ranks.size} only: {_REMEDY}")
    return ranks


def _survives_losses() -> bool:
    """Whether the launcher keeps the other ranks when a process is lost, and mpi4py can report the loss."""
    if os.environ.get(_TOLERANT, "0").lower() not in ("1", "true"):
        return False
    version = tuple(int(part) for part in metadata.version("mpi4py").split(".")[:2])
    return version >= (4, 1)


def wait_for_message(ranks: Ranks) -> object:
    """The next message; for ranks that have nothing else to do."""
    while (received := ranks.receive()) is None:
        time.sleep(POLL_SECONDS)
    return received[1]
