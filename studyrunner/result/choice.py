"""Combinations of axes that a figure shows."""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from studyrunner.statistics.samples import SAMPLE
from studyrunner.system.progress import count

if TYPE_CHECKING:
    from studyrunner.result.view import Result


@dataclass(frozen=True)
class Choice:
    """Combinations of the axes that a figure shows, with labels.

    sentence: on combinations that are left out; empty where there are none.
    """

    points: tuple[dict[str, int], ...]
    labels: tuple[str, ...]
    sentence: str

    def __iter__(self) -> Iterator[tuple[dict[str, int], str]]:
        """Combinations with their labels."""
        return iter(zip(self.points, self.labels, strict=True))


def choose(result: Result, free: Collection[str], limit: int, first: tuple[str, ...] = ("scheme", "sweep")) -> Choice:
    """At most `limit` combinations of the axes that are not `free`; the one of the shown point is among them.

    Where there are more, the axes `first` are split first, then the others in the order of the file, each whole or
    not at all; the rest stays at the shown point.
    """
    order = [name for name in (*first, *result.axes) if name in result.varying and name not in free]
    order = list(dict.fromkeys(order))
    shown = {name: index for name, index in result.shown_point().items() if name not in free}
    split: list[str] = []
    number = 1
    for name in order:
        size = result.dataset.sizes[name]
        if number * size <= limit:
            split.append(name)
            number *= size
    split.sort(key=result.axes.index)
    ranges = [range(result.dataset.sizes[name]) for name in split]
    points = tuple({**shown, **dict(zip(split, place, strict=True))} for place in itertools.product(*ranges))
    labels = tuple(result.describe(point, split) for point in points)
    sizes = {name: result.dataset.sizes[name] for name in order if name not in split}
    sizes |= {name: size for name, size in result.fixed.items() if name not in free}
    fixed = [name for name in result.axes if name in sizes]
    if not fixed:
        return Choice(points, labels, "")
    others = " and ".join(
        count(sizes[name] - 1, "other sample" if name == SAMPLE else "other value")
        + ("" if name == SAMPLE else f" of {name.replace('_', ' ')}")
        for name in fixed
    )
    sentence = f"Shown for {result.describe(shown, fixed)}; the file also holds {others}."
    return Choice(points, labels, sentence)
