"""Keys of caches for objects that are large and never change: those very objects, not others of the same values."""

from __future__ import annotations


class Identity:
    """Some objects as one hashable key. It keeps them alive, so that no other gets their identity."""

    def __init__(self, *objects: object) -> None:
        self.objects = objects

    def __hash__(self) -> int:
        return hash(tuple(map(id, self.objects)))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Identity) and all(
            ours is theirs for ours, theirs in zip(self.objects, other.objects, strict=True)
        )
