"""Faults of the machine, which say nothing of the point that was computed: a disk, memory, the cache of the kernels."""

from __future__ import annotations

import builtins
import math
import resource

_FAULTS = (OSError, MemoryError, EOFError, ImportError)
# the last two by name: what numba raises where its cache is cut off, and numpy where memory is not there
_NAMES = frozenset(
    kind.__name__ for kind in vars(builtins).values() if isinstance(kind, type) and issubclass(kind, _FAULTS)
) | {"UnpicklingError", "_ArrayMemoryError"}


LEAST_ADDRESS_SPACE = 1e9
"""Bytes of address space that the libraries alone need: a small study takes 0.8 GB with two ranks, of which 0.3 GB are
in memory. With less a library that is loaded late ends the run, or the allocation of memory ends the process."""


def address_space() -> float:
    """Limit of the address space of this process, bytes (`ulimit -v`); inf for none."""
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return math.inf if limit == resource.RLIM_INFINITY else float(limit)


class MachineFaultError(Exception):
    """A task broke off for a reason that is not in it: it is to be done once more, elsewhere if there is a choice."""


def is_fault_of_machine(error: BaseException) -> bool:
    """Whether an error says something of the machine."""
    return isinstance(error, (MachineFaultError, *_FAULTS)) or type(error).__name__ in _NAMES


def tells_of_machine(message: str) -> bool:
    """The same of what `describe_error` made of it."""
    return message.partition(":")[0] in _NAMES
