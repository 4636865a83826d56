"""CPU time of a computation, without the time in which kernels are compiled or loaded from the cache."""

import threading
import time

from numba.core.event import Event, Listener, register


class _Compiler(Listener, threading.local):
    """CPU time, s, that each thread spends on compiling or loading kernels, which may be nested."""

    spent = 0.0
    _depth = 0
    _began = 0.0

    def on_start(self, _: Event) -> None:
        if self._depth == 0:
            self._began = time.thread_time()
        self._depth += 1

    def on_end(self, _: Event) -> None:
        self._depth -= 1
        if self._depth == 0:
            self.spent += time.thread_time() - self._began


_compiler = _Compiler()
# this lock is held while a kernel is compiled or read from the cache
register("numba:compiler_lock", _compiler)  # type: ignore[no-untyped-call]


def computing_time() -> float:
    """CPU time of this thread, s, without the time of compiling. The difference of two values is a duration."""
    return time.thread_time() - _compiler.spent
