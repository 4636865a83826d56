"""The error that a user can cause with a scene: wrong parameters or a wrong scene file."""

from __future__ import annotations


class SceneError(ValueError):
    """A scene that cannot be built or read.

    key: what is wrong, as the user wrote it: a dotted parameter ("loss_factor") or a dataset ("contact/dofs").
    value: what was found there, in a few words.
    remedy: what would be right, one clause without a full stop.
    """

    def __init__(self, key: str, value: str, remedy: str) -> None:
        # All three go to `args`: an exception is pickled through them when it travels between ranks.
        super().__init__(key, value, remedy)
        self.key = key
        self.value = value
        self.remedy = remedy

    def __str__(self) -> str:
        return f"{self.key}: {self.value}; {self.remedy}."
