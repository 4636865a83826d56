"""CPU time of a computation, without the time in which kernels are compiled or loaded from the cache."""

from __future__ import annotations

import threading
import time

from numba.core.event import Event, Listener, register


class _Compiler(Listener, threading.local):
    """CPU time, s, that each thread spends on compiling or loading kernels. Kernels may be nested."""

    def __init__(self) -> None:
        self.spent = 0.0
        self._depth = 0
        self._began = 0.0

    def on_start(self, event: Event) -> None:  # noqa: ARG002
        """Begin of a kernel."""
        if self._depth == 0:
            self._began = time.thread_time()
        self._depth += 1

    def on_end(self, event: Event) -> None:  # noqa: ARG002
        """End of a kernel."""
        self._depth -= 1
        if self._depth == 0:
            self.spent += time.thread_time() - self._began


class _Compilations(Listener):
    """Number of kernels that were compiled, without those read from the cache."""

    def __init__(self) -> None:
        self.number = 0

    def on_start(self, event: Event) -> None:  # noqa: ARG002
        """Begin of a compilation."""
        self.number += 1

    def on_end(self, event: Event) -> None:
        """End of a compilation: nothing to count."""


_compiler = _Compiler()
_compilations = _Compilations()
# The lock is held while a kernel is compiled or read from the cache.
register("numba:compiler_lock", _compiler)  # type: ignore[no-untyped-call]
register("numba:compile", _compilations)  # type: ignore[no-untyped-call]


def computing_time() -> float:
    """CPU time of this thread, s, without the time of compiling. The difference of two values is a duration."""
    return time.thread_time() - _compiler.spent


def n_compiled() -> int:
    """Number of kernels that this process has compiled so far; above zero in the first run after an installation."""
    return _compilations.number
