"""When functions are compiled in this process: what a user waits for, and no part of what a task takes."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from numba.core.event import Event, Listener, register

COMPILING = "compiling the solver, once after an installation"

_LOCK, _COMPILE = "numba:compiler_lock", "numba:compile"
"""Events of numba: the lock is held while a function is compiled or read from the cache. They may be nested."""


class _Compiler(Listener):
    """seconds: in which the lock was held so far. say: takes `COMPILING`, and "" where a function is compiled."""

    def __init__(self) -> None:
        self.seconds, self._began = 0.0, 0.0
        self.say: Callable[[str], object] = str
        self._depth = Counter[str]()

    def on_start(self, event: Event) -> None:
        """Begin of an event."""
        if not self._depth[event.kind]:
            self._began = time.perf_counter() if event.kind == _LOCK else self._began
            self.say(COMPILING) if event.kind == _COMPILE else None
        self._depth[event.kind] += 1

    def on_end(self, event: Event) -> None:
        """End of an event."""
        self._depth[event.kind] -= 1
        if not self._depth[event.kind]:
            self.seconds += time.perf_counter() - self._began if event.kind == _LOCK else 0.0
            self.say("") if event.kind == _COMPILE else None


_compiler = _Compiler()
for _kind in (_LOCK, _COMPILE):
    register(_kind, _compiler)  # type: ignore[no-untyped-call]


def working_seconds() -> float:
    """A clock, s, that stands still while a function is compiled or read from the cache."""
    return time.perf_counter() - _compiler.seconds


@contextmanager
def telling(say: Callable[[str], object]) -> Iterator[None]:
    """Inside, `say` is given `COMPILING` where a function begins to be compiled, and "" at its end."""
    _compiler.say = say
    try:
        yield
    finally:
        _compiler.say = str
