"""What a variable of a result file is."""

from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class Variable:
    """One variable of the result: its dimensions after the axes, its unit and what it means.

    dtype: of numpy. Floating numbers are NaN where there is no result, whole ones 0. flags: what the values 0, 1, ...
    mean, one word each. content: what ACDD calls its type. comment: what a reader would ask next.
    """

    dimensions: tuple[str, ...]
    units: str
    long_name: str
    comment: str = ""
    dtype: str = "float64"
    flags: tuple[str, ...] = ()
    content: str = "modelResult"

    @property
    def is_text(self) -> bool:
        """Whether the values are texts."""
        return self.dtype.startswith(("U", "str"))


def in_metres(responses: Iterable[object]) -> list[int]:
    """Places of the responses, by name, that share a scale: without a unit in the name; all where each has one."""
    names = list(map(str, responses))
    return [place for place, name in enumerate(names) if not name.endswith("]")] or list(range(len(names)))
