"""What a variable of a result file is."""

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
