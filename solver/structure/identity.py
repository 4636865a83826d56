"""Cache keys for large objects that never change. A key stands for the objects themselves, not for equal values."""

from __future__ import annotations


class Identity:
    """Some objects as one hashable key. The key keeps the objects alive, so that their `id` is not used again."""

    def __init__(self, *objects: object) -> None:
        self.objects = objects

    def __hash__(self) -> int:
        return hash(tuple(map(id, self.objects)))

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Identity) and all(
            ours is theirs for ours, theirs in zip(self.objects, other.objects, strict=True)
        )
