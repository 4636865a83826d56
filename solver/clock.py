"""CPU time of computing: what a kernel takes to be compiled, or to be loaded, says nothing of what is computed."""

from __future__ import annotations

import threading
import time

from numba.core.event import Event, Listener, register


class _Compiler(Listener, threading.local):
    """Takes note of the CPU time, s, that each thread spends on kernels; one may need others."""

    def __init__(self) -> None:
        self.spent = 0.0
        self._depth = 0
        self._began = 0.0

    def on_start(self, event: Event) -> None:  # noqa: ARG002
        """A kernel is taken up."""
        if self._depth == 0:
            self._began = time.thread_time()
        self._depth += 1

    def on_end(self, event: Event) -> None:  # noqa: ARG002
        """It is ready."""
        self._depth -= 1
        if self._depth == 0:
            self.spent += time.thread_time() - self._began


class _Compilations(Listener):
    """Counts the kernels that are compiled: one that is read from the cache is not."""

    def __init__(self) -> None:
        self.number = 0

    def on_start(self, event: Event) -> None:  # noqa: ARG002
        """A kernel is compiled from now on."""
        self.number += 1

    def on_end(self, event: Event) -> None:
        """It is ready."""


_compiler = _Compiler()
_compilations = _Compilations()
# The lock is held while a kernel is compiled or read from the cache.
register("numba:compiler_lock", _compiler)  # type: ignore[no-untyped-call]
register("numba:compile", _compilations)  # type: ignore[no-untyped-call]


def computing_time() -> float:
    """CPU time of this thread, s, without that of compiling; differences of it are what something takes."""
    return time.thread_time() - _compiler.spent


def n_compiled() -> int:
    """Kernels that this process has had to compile so far, as in the first run after an installation."""
    return _compilations.number
