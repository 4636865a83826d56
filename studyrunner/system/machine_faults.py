"""Faults of the machine, which say nothing of the point that was computed: a disk, memory, the cache of the kernels.

By hand: numba has no option by which a cache that is damaged or full costs time only.
"""

from __future__ import annotations

import builtins
import contextlib
import math
import resource
from typing import Any

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


def guard_kernel_cache() -> None:
    """Compiled kernels are kept on the disk: where that does not work they are compiled anew, and kept where possible.

    A full quota, or a file that was cut off, then costs the time to compile, and no task. To be called before any
    kernel is loaded.
    """
    from numba.core import caching, dispatcher

    cache: Any = caching.Cache
    compiled: Any = dispatcher.Dispatcher
    own_load, own_save, own_enable = cache.load_overload, cache.save_overload, compiled.enable_caching
    if getattr(own_load, "guarded", False):
        return

    def load(self: Any, signature: object, target: object) -> object:
        try:
            return own_load(self, signature, target)
        except Exception:
            # what is damaged is replaced by what is compiled now
            with contextlib.suppress(Exception):
                self.flush()
            return None

    def save(self: Any, signature: object, data: object) -> None:
        with contextlib.suppress(Exception):
            own_save(self, signature, data)

    def enable(self: Any) -> None:
        # numba knows no folder that it could write into
        with contextlib.suppress(RuntimeError):
            own_enable(self)

    load.guarded = True  # type: ignore[attr-defined]
    cache.load_overload, cache.save_overload, compiled.enable_caching = load, save, enable
