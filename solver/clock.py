"""CPU time of a computation, without the time in which kernels are compiled or loaded from the cache."""

from __future__ import annotations

import threading
import time
from typing import ClassVar

from numba.core.event import Event, Listener, register

_LOCK, _COMPILE = "numba:compiler_lock", "numba:compile"
"""Events of numba: the lock is held while a kernel is compiled or read from the cache."""


class _Compiler(Listener, threading.local):
    """CPU time, s, that each thread spends on compiling or loading kernels, which may be nested.

    n_compiled: kernels compiled by all threads, without those read from the cache.
    """

    n_compiled: ClassVar[int] = 0

    def __init__(self) -> None:
        self.spent = 0.0
        self._depth = 0
        self._began = 0.0

    def on_start(self, event: Event) -> None:
        """Begin of a kernel."""
        if event.kind == _COMPILE:
            _Compiler.n_compiled += 1
            return
        if self._depth == 0:
            self._began = time.thread_time()
        self._depth += 1

    def on_end(self, event: Event) -> None:
        """End of a kernel."""
        if event.kind == _LOCK:
            self._depth -= 1
            if self._depth == 0:
                self.spent += time.thread_time() - self._began


_compiler = _Compiler()
for _kind in (_LOCK, _COMPILE):
    register(_kind, _compiler)  # type: ignore[no-untyped-call]


def computing_time() -> float:
    """CPU time of this thread, s, without the time of compiling. The difference of two values is a duration."""
    return time.thread_time() - _compiler.spent


def n_compiled() -> int:
    """Number of kernels that this process has compiled so far; above zero in the first run after an installation."""
    return _Compiler.n_compiled
