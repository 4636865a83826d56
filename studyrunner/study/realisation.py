"""A study in parts that have one scene each: for each combination of the axes that are keys of [scene] or [wear]."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

from studyrunner.study.study import Study


@dataclass(frozen=True)
class Realisation:
    """A part of a study.

    study: without axes that are keys of [scene] or [wear].
    place: indices along these axes of the whole study, which are its last ones.
    """

    study: Study
    place: tuple[int, ...]


def realise(study: Study) -> tuple[Realisation, ...]:
    """The parts of a study, in the order of their places; the study itself where it has no such axes."""
    places = itertools.product(*(range(len(axis.values)) for axis in study.scene_axes))
    return tuple(Realisation(part, place) for part, place in zip(study.variants or (study,), places, strict=True))
