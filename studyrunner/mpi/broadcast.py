"""Sends an object to all ranks: once to each machine, whose ranks share the arrays of the object.

Rank 0 sends the object to one rank of every other machine. This rank, and rank 0 on its own machine, puts the object
into shared memory and tells the other ranks of the machine the address. A rank that cannot map the memory gets a copy
of its own.

By hand: a broadcast of MPI waits for all ranks, cannot be interrupted, and gives each rank a copy of its own.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from studyrunner.mpi.ranks import POLL_SECONDS, Ranks
from studyrunner.mpi.shared_memory import Address, SharedObject, open_shared
from studyrunner.mpi.version_check import Machine

Thing = TypeVar("Thing")


@dataclass(frozen=True)
class _Whole:
    """The object, and the ranks of this machine that wait for it."""

    thing: object
    others: tuple[int, ...] = ()


@dataclass(frozen=True)
class _From:
    """The object comes from another rank of the machine."""

    leader: int


@dataclass(frozen=True)
class _Mapped:
    """Whether a rank has mapped the memory at the address."""

    done: bool


class Broadcast(Generic[Thing]):
    """Rank 0: an object for all ranks.

    value: the object; where other ranks are on this machine, its arrays are in shared memory.
    sharing: ranks that have mapped this memory, rank 0 with them; empty until the object is sent.
    """

    def __init__(self, ranks: Ranks, machines: Mapping[int, Machine], thing: Thing) -> None:
        self._ranks = ranks
        groups: dict[Machine, list[int]] = {}
        for rank in sorted(machines):
            groups.setdefault(machines[rank], []).append(rank)
        self._groups = tuple(groups.values())
        self.sharing: frozenset[int] = frozenset()
        self._shared = share(thing) if len(self._groups[0]) > 1 else None
        self.value = thing if self._shared is None else self._shared.value

    def send(self) -> None:
        """Sends the object to every other rank. Raises KeyboardInterrupt where a rank was interrupted."""
        (_, *neighbours), *elsewhere = self._groups
        for leader, *others in elsewhere:
            self._ranks.send(_Whole(self.value, tuple(others)), leader)
            for rank in others:
                self._ranks.send(_From(leader), rank)
        mapped = _tell(self._ranks, self._shared, self.value, neighbours)
        self.sharing = frozenset({0, *mapped}) if mapped else frozenset()


def take_over(ranks: Ranks) -> Any:  # a type that rank 0 knows
    """Any other rank: the object that rank 0 sends; None where rank 0 sends None."""
    message = _next_from(ranks, 0)
    leader = message.leader if isinstance(message, _From) else 0
    if leader:
        message = _next_from(ranks, leader)
    if isinstance(message, Address):
        try:
            thing = open_shared(message)
        except OSError:
            ranks.send(_Mapped(False), leader)
            message = _next_from(ranks, leader)
        else:
            ranks.send(_Mapped(True), leader)
            ranks.flush()
            return thing
    if isinstance(message, _Whole):
        shared = share(message.thing) if message.others else None
        thing = message.thing if shared is None else shared.value
        _tell(ranks, shared, thing, message.others)
        return thing
    if message is not None:
        raise TypeError(f"rank {leader} sent {message!r} instead of what it hands out")
    return None


def share(thing: Thing) -> SharedObject[Thing] | None:
    """The object in shared memory; None where the system has none, or not enough."""
    with contextlib.suppress(OSError):
        return SharedObject(thing)
    return None


def _tell(ranks: Ranks, shared: SharedObject[Thing] | None, thing: Thing, others: Sequence[int]) -> list[int]:
    """Tells the other ranks of a machine the address of the object, and waits until they have mapped it.

    Returns the ranks that have.
    """
    mapped: list[int] = []
    for rank in others:
        ranks.send(_Whole(thing) if shared is None else shared.address, rank)
    if shared is None:
        return mapped
    for rank in others:
        answer = _next_from(ranks, rank)
        if not isinstance(answer, _Mapped):
            raise KeyboardInterrupt
        if answer.done:
            mapped.append(rank)
        else:
            ranks.send(_Whole(thing), rank)
    shared.close()
    return mapped


def _next_from(ranks: Ranks, rank: int) -> object:
    while (received := ranks.receive(rank)) is None:
        time.sleep(POLL_SECONDS)
    return received[1]
