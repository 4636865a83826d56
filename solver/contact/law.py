"""The contact law of all pairs of a joint through one period: a list of elements, each with some of the pairs.

Alternating frequency-time method: predicted force to samples, contact law, contact force back to harmonics. Pairs on an
elastic joint are `CoulombPairs`, masses on rigid ground `SlidingMasses`; `solver.structure.penalty` chooses.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
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
class ContactLaw:
    """The law of the n_contact pairs of a joint at one frequency: methods as in `Element`, arrays of all pairs.

    elements: each pair belongs to one.
    """

    elements: tuple[Element, ...]

    @property
    def rate_dependent(self) -> bool:  # noqa: D102
        return any(each.rate_dependent for each in self.elements)

    @property
    def moves_on(self) -> BoolArray:
        """Pairs (n_contact,) whose mean position the law alone does not determine: masses."""
        return self._joined([np.full(each.places.size, each.rate_dependent) for each in self.elements])

    @property
    def sample_step(self) -> float:  # noqa: D102
        return self.elements[0].sample_step

    @cached_property
    def _order(self) -> IntArray:
        """Places of the pairs among those of the elements one after the other."""
        return np.argsort(np.concatenate([each.places for each in self.elements]))

    def _joined(self, parts: list[A], axis: int = 0) -> A:
        """Values of all pairs from those of each element."""
        return parts[0] if len(parts) == 1 else cast("A", np.take(np.concatenate(parts, axis), self._order, axis))

    @property
    def n_history(self) -> int:
        """Length of the history of a pair; shorter ones end with zeros."""
        return max(each.n_history for each in self.elements)

    def _part(self, element: Element, values: FloatArray) -> FloatArray:
        """Values of the pairs of one element."""
        return values if len(self.elements) == 1 else values[element.places]

    def _history(self, element: Element, history: FloatArray) -> FloatArray:
        """The history of one element from that of all pairs."""
        return self._part(element, history)[:, : element.n_history]

    def _histories(self, parts: list[FloatArray]) -> FloatArray:
        """The history of all pairs from those of each element."""
        if len(parts) == 1:
            return parts[0]
        return self._joined([np.pad(each, ((0, 0), (0, self.n_history - each.shape[1]))) for each in parts])

    def _of(self, element: Element, at: Marched) -> Marched:
        """The march of one element."""
        return at if len(self.elements) == 1 else at.at(element.places)

    def _each(self, compute: Callable[[Element, Marched], FloatArray], at: Marched) -> FloatArray:
        """Values of all pairs from what each element says of its part."""
        return self._joined([compute(each, self._of(each, at)) for each in self.elements])

    def march(self, predicted_h: FloatArray, history: FloatArray, first: FloatArray | None = None) -> Marched:  # noqa: D102
        parts = list[Marched]()
        for each in self.elements:
            begin = None if first is None else self._part(each, first)
            parts.append(each.march(self._part(each, predicted_h), self._history(each, history), begin))
        if len(parts) == 1:
            return parts[0]
        joined: dict[str, Any] = {"periodicity_error": max(each.periodicity_error for each in parts)}
        for name in (each.name for each in fields(Marched) if each.name not in joined):
            joined[name] = self._joined([getattr(each, name) for each in parts])
        return Marched(**joined)

    def tangent(self, at: Marched, history: FloatArray | None = None, first: FloatArray | None = None) -> Tangents:
        """As in `Element`, returned. Entries of displacements that a pair does not have are without meaning."""
        found, size = [], 3 * at.force_h.shape[2]
        for each in self.elements:
            part, own = self._of(each, at), each.places
            out = np.zeros((own.size, size, size)), np.zeros((own.size, size))
            before = None if history is None else self._history(each, history)
            each.tangent(part, before, None if first is None else self._part(each, first), out)
            out[0][part.stuck] = np.eye(size)
            found.append(out)
        force, work = (self._joined([each[place] for each in found]) for place in (0, 1))
        return force, work

    def friction_work(self, at: Marched) -> FloatArray:  # noqa: D102
        return self._each(lambda each, part: each.friction_work(part), at)

    def sample_tangents(self, at: Marched, stride: int = 1) -> tuple[FloatArray, FloatArray]:  # noqa: D102
        parts = [each.sample_tangents(self._of(each, at), stride) for each in self.elements]
        own, carried = (self._joined([each[place] for each in parts], 1) for place in (0, 1))
        return own, carried

    def sampled(self, at: Marched, pairs: IntArray) -> SampledLaw:
        """As in `Element`; pairs ascend."""
        parts = []
        for each in self.elements:
            wanted = np.flatnonzero(np.isin(each.places, pairs))
            parts.append((each.places[wanted], vars(each.sampled(self._of(each, at), wanted)).values()))
        order = np.argsort(np.concatenate([places for places, _ in parts]))
        return SampledLaw(*(np.concatenate(each, 1)[:, order] for each in zip(*(of for _, of in parts), strict=True)))

    @cached_property
    def compliance(self) -> ComplexArray:  # noqa: D102
        return self._joined([each.compliance for each in self.elements])

    def motion(self, correction: FloatArray) -> FloatArray:
        """Motion (n_contact, 3, m, ...), m, relative to `origin`, from predicted less contact force, N, Eq. (12)."""
        return _scaled(correction, self.compliance)

    def force(self, motion: FloatArray) -> FloatArray:
        """Predicted less contact force (n_contact, 3, m), N, of a motion, m, Eqs. (10), (12); undoes `motion`."""
        return _scaled(motion, 1.0 / self.compliance)

    def origin(self, history: FloatArray) -> FloatArray:  # noqa: D102
        return self._joined([each.origin(self._history(each, history)) for each in self.elements])

    @cached_property
    def state_stiffness(self) -> FloatArray:  # noqa: D102
        return self._joined([each.state_stiffness for each in self.elements])

    def final_history(self, at: Marched, displacement_h: FloatArray) -> FloatArray:  # noqa: D102
        ends = [each.final_history(self._of(each, at), self._part(each, displacement_h)) for each in self.elements]
        return self._histories(ends)

    def started_from(self, at: Marched, history: FloatArray) -> FloatArray:  # noqa: D102
        begun = [each.started_from(self._of(each, at), self._history(each, history)) for each in self.elements]
        return self._histories(begun)

    def relieved(self, history: FloatArray, force: FloatArray) -> FloatArray:  # noqa: D102
        parts = [each.relieved(self._history(each, history), self._part(each, force)) for each in self.elements]
        return self._histories(parts)

    def begun_at(self, mean: FloatArray, last: FloatArray) -> FloatArray:  # noqa: D102
        return self._histories(
            [each.begun_at(self._part(each, mean), self._part(each, last)) for each in self.elements]
        )

    def drift(self, at: Marched) -> FloatArray:  # noqa: D102
        return self._each(lambda each, part: each.drift(part), at)

    def change_force(self, at: Marched) -> FloatArray:  # noqa: D102
        return self._each(lambda each, part: each.change_force(part), at)

    def driving_force(self, at: Marched) -> float:  # noqa: D102
        return max(each.driving_force(self._of(each, at)) for each in self.elements)

    def tail(self, at: Marched, basis: FourierBasis) -> FloatArray:  # noqa: D102
        return self._each(lambda each, part: each.tail(part, basis), at)

    def beyond_series(self, at: Marched, series_t: FloatArray) -> FloatArray:  # noqa: D102
        return self._each(lambda each, part: each.beyond_series(part, self._part(each, series_t)), at)


def build_law(penalty: Penalty, contact: ContactInterface, basis: FourierBasis, omega: float) -> ContactLaw:
    """The law of a joint at omega, rad/s."""
    makers: list[tuple[Callable[..., Element], IntArray]] = [
        (CoulombPairs, np.flatnonzero(contact.rubs & ~penalty.inertial)),
        (SlidingMasses, np.flatnonzero(penalty.inertial)),
        *((each.element, np.array(each.pairs)) for each in contact.laws),
    ]
    return ContactLaw(
        tuple(
            make(at, penalty.at(at), contact.friction[at], contact.dofs[at], basis, omega)
            for make, at in makers
            if at.size
        )
    )


def _scaled(values_h: FloatArray, factor: ComplexArray) -> FloatArray:
    """Series (k, 3, m, ...) with their complex amplitudes times the factor (k, 3, H+1) of each harmonic."""
    tail = (1,) * (values_h.ndim - 3)
    real, imaginary = (part.reshape(*factor.shape, *tail) for part in (factor.real, factor.imag))
    cosine, sine = values_h[:, :, 1::2], values_h[:, :, 2::2]
    scaled = np.empty_like(values_h)
    scaled[:, :, 0] = real[:, :, 0] * values_h[:, :, 0]
    # a complex amplitude is cosine - i sine
    scaled[:, :, 1::2] = real[:, :, 1:] * cosine + imaginary[:, :, 1:] * sine
    scaled[:, :, 2::2] = real[:, :, 1:] * sine - imaginary[:, :, 1:] * cosine
    return scaled
