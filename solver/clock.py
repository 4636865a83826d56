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


_compiler = _Compiler()
# The lock is held while a kernel is compiled or read from the cache.
register("numba:compiler_lock", _compiler)  # type: ignore[no-untyped-call]


def computing_time() -> float:
    """CPU time of this thread, s, without that of compiling; differences of it are what something takes."""
    return time.thread_time() - _compiler.spent
