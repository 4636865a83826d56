"""When functions are compiled in this process: what a user waits for, and no part of what a task takes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from numba.core.event import Event, Listener, register

COMPILING = "compiling the solver, once after an installation"


class _Compiler(Listener):
    """seconds: of compiling so far. say: takes `COMPILING` where a function begins to be compiled, and "" at its end."""

    def __init__(self) -> None:
        self.seconds, self._began, self._depth = 0.0, 0.0, 0
        self.say: Callable[[str], object] = str

    def on_start(self, event: Event) -> None:  # noqa: ARG002
        """Begin of a function, which may be inside another one."""
        if self._depth == 0:
            self._began = time.perf_counter()
            self.say(COMPILING)
        self._depth += 1

    def on_end(self, event: Event) -> None:  # noqa: ARG002
        """End of a function."""
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.perf_counter() - self._began
            self.say("")


_compiler = _Compiler()
register("numba:compile", _compiler)  # type: ignore[no-untyped-call]


def working_seconds() -> float:
    """A clock, s, that stands still while a function is compiled."""
    return time.perf_counter() - _compiler.seconds


@contextmanager
def telling(say: Callable[[str], object]) -> Iterator[None]:
    """Inside, `say` is given `COMPILING` where a function begins to be compiled, and "" at its end."""
    _compiler.say = say
    try:
        yield
    finally:
        _compiler.say = str
