"""What one thread tells another one, which waits for it in a way that no signal makes endless.

By hand: `queue.SimpleQueue` may wait for ever after a signal, see `Mailbox`.
"""

from __future__ import annotations

import threading
from collections import deque
from contextlib import suppress
from typing import Generic, TypeVar

Message = TypeVar("Message")

LONGEST_WAIT = 0.05
"""Seconds: a signal that another thread of the process was given is noticed after so long, at the latest."""


class Mailbox(Generic[Message]):
    """Messages in their order, for one thread that takes them.

    `queue.SimpleQueue` of Python 3.11 is none: where a signal comes to its `get(timeout)` and is dealt with after the
    deadline, as another thread holds the interpreter, it takes what is left of the time, which is negative then, for no
    limit. `acquire` of a lock looks whether it is negative.
    """

    def __init__(self) -> None:
        self._messages: deque[Message] = deque()
        # free as long as there is news; written in C: one that is written in Python, as that of an Event, may stay
        # taken where its owner is interrupted
        self._news = threading.Lock()
        self._news.acquire()

    def put(self, message: Message) -> None:
        """One more; never waits."""
        self._messages.append(message)
        with suppress(RuntimeError):  # it is free already
            self._news.release()

    def first(self) -> Message | None:
        """The next message, which stays where it is; None where there is none."""
        return self._messages[0] if self._messages else None

    def take(self) -> Message | None:
        """The next message, None where there is none."""
        return self._messages.popleft() if self._messages else None

    def wait(self, seconds: float = LONGEST_WAIT) -> None:
        """Returns when there is a message, after so many seconds, or earlier."""
        if not self._messages:
            self._news.acquire(timeout=seconds)
