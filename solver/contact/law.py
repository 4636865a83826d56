"""The contact law of all pairs of a joint through one period: one element, or several with some of the pairs each.

Alternating frequency-time method: predicted force to samples, contact law, contact force back to harmonics. Pairs on an
elastic joint are `CoulombPairs`, masses on rigid ground `SlidingMasses`; `solver.structure.penalty` chooses.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar, cast

import numpy as np

from solver.contact.elastic import CoulombPairs
from solver.contact.element import Element, Marched, SampledLaw, Tangents
from solver.contact.masses import SlidingMasses
from solver.model import BoolArray, ComplexArray, ContactInterface, FloatArray, IntArray

if TYPE_CHECKING:
    from solver.structure.fourier import FourierBasis
    from solver.structure.penalty import Penalty

A = TypeVar("A", FloatArray, ComplexArray, BoolArray)


@dataclass(frozen=True)
class Elements(Element):
    """Pairs that follow several laws. parts: each pair belongs to one; a shorter history of a pair ends with zeros."""

    parts: tuple[Element, ...]

    @property
    def rate_dependent(self) -> bool:  # noqa: D102
        return any(each.rate_dependent for each in self.parts)

    @property
    def n_history(self) -> int:  # noqa: D102
        return max(each.n_history for each in self.parts)

    def rubbing(self, friction: FloatArray) -> Element:  # noqa: D102
        parts = tuple(each.rubbing(friction) for each in self.parts)
        return replace(self, friction_coefficient=friction, parts=parts)

    @cached_property
    def _order(self) -> IntArray:
        """Places of the pairs among those of the elements one after the other."""
        return np.argsort(np.concatenate([each.places for each in self.parts]))

    def _joined(self, values: list[A], axis: int = 0) -> A:
        """Values of all pairs from those of each element."""
        return cast("A", np.take(np.concatenate(values, axis), self._order, axis))

    def _each(self, compute: Callable[[Element, IntArray], FloatArray]) -> FloatArray:
        """Values of all pairs from what each element says of its places; shorter ones end with zeros."""
        return self._joined(_padded([compute(each, each.places) for each in self.parts], 1))

    def march(self, predicted_h: FloatArray, history: FloatArray, before_t: FloatArray | None, /) -> Marched:  # noqa: D102
        parts = list[Marched]()
        for each in self.parts:
            begin = None if before_t is None else before_t[each.places]
            parts.append(each.march(predicted_h[each.places], each.own(history), begin))
        inner = self._joined(_padded([each.inner for each in parts], 1))
        joined: dict[str, Any] = {"periodicity_error": max(each.periodicity_error for each in parts), "inner": inner}
        for name in (each.name for each in fields(Marched) if each.name not in joined):
            joined[name] = self._joined([getattr(each, name) for each in parts])
        return Marched(**joined)

    def tangent(  # noqa: D102
        self, at: Marched, history: FloatArray | None = None, before_t: FloatArray | None = None
    ) -> Tangents:
        found = list[Tangents]()
        for each in self.parts:
            before = None if history is None else each.own(history)
            found.append(each.tangent(at.at(each.places), before, None if before_t is None else before_t[each.places]))
        force, work, by_friction = (self._joined([each[place] for each in found]) for place in range(3))
        return force, work, by_friction

    def friction_work(self, at: Marched) -> FloatArray:  # noqa: D102
        return self._each(lambda each, places: each.friction_work(at.at(places)))

    def sample_tangents(self, at: Marched, stride: int = 1) -> tuple[FloatArray, FloatArray]:  # noqa: D102
        found = [each.sample_tangents(at.at(each.places), stride) for each in self.parts]
        own, carried = (self._joined([each[place] for each in found], 1) for place in (0, 1))
        return own, carried

    def sampled(self, at: Marched, pairs: IntArray) -> SampledLaw:
        """As in `Element`; pairs ascend."""
        parts = []
        for each in self.parts:
            wanted = np.flatnonzero(np.isin(each.places, pairs))
            parts.append((each.places[wanted], vars(each.sampled(at.at(each.places), wanted)).values()))
        order = np.argsort(np.concatenate([places for places, _ in parts]))
        columns = zip(*(of for _, of in parts), strict=True)
        return SampledLaw(*(np.concatenate(_padded(list(each), 2), 1)[:, order] for each in columns))

    @cached_property
    def compliance(self) -> ComplexArray:  # noqa: D102
        return self._joined([each.compliance for each in self.parts])

    def final_history(self, at: Marched, motion: FloatArray, /) -> FloatArray:  # noqa: D102
        return self._each(lambda each, places: each.final_history(at.at(places), motion[places]))

    def started_from(self, at: Marched, history: FloatArray, /) -> FloatArray:  # noqa: D102
        return self._each(lambda each, places: each.started_from(at.at(places), each.own(history)))

    def relieved(self, history: FloatArray, force: FloatArray, /) -> FloatArray:  # noqa: D102
        return self._each(lambda each, places: each.relieved(each.own(history), force[places]))


def _padded(values: list[FloatArray], first: int) -> list[FloatArray]:
    """Values of each element, those of the others as long as the longest from an axis on: with zeros at the end."""
    longest = np.max([each.shape[first:] for each in values], axis=0)
    return [np.pad(each, [(0, 0)] * first + [(0, n) for n in longest - each.shape[first:]]) for each in values]


def build_law(penalty: Penalty, contact: ContactInterface, basis: FourierBasis, omega: float) -> Element:
    """The law of a joint at omega, rad/s."""
    makers: list[tuple[Callable[..., Element], IntArray]] = [
        (CoulombPairs, np.flatnonzero(contact.rubs & ~penalty.inertial)),
        (SlidingMasses, np.flatnonzero(penalty.inertial)),
        *((each.element, np.array(each.pairs)) for each in contact.laws),
    ]

    def of_pairs(places: IntArray) -> tuple[IntArray, Penalty, FloatArray, IntArray, FourierBasis, float]:
        return places, penalty.at(places), contact.friction[places], contact.dofs[places], basis, omega

    parts = tuple(make(*of_pairs(places)) for make, places in makers if places.size)
    return parts[0] if len(parts) == 1 else Elements(*of_pairs(np.arange(contact.n_contact)), parts)
