"""Projection of forms on static shapes, which are never formed as a whole.

The shapes follow from the displacements of the boundary, front by front from the last front to the first. Two measures
make this fast. On a large boundary far from the driven nodes all shapes are combinations of a few shapes: only these go
on. On small boundaries the forms themselves are condensed: static condensation of a structure is the sum of the
condensations of its parts (Guyan 1965).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy import sparse
from scipy.linalg import blas, qr

from solver.model import IntArray
from studies.finite_element.condensation.dissection import Front, dofs_of
from studies.finite_element.condensation.extend_add import add_lower
from studies.finite_element.condensation.factor import (
    Dense,
    Factor,
    mirrored,
    places_in_parent,
    solve_lower,
    times,
)
from studies.finite_element.condensation.ordered_form import OrderedForm

# Displacements of a boundary to which it costs more to condense forms than to follow combined shapes: at least so many,
# and so many for each shape. Bundled dovetail, 336 pairs, 1008 shapes: 700, 1400, 2000 and 2600 displacements take
# 27, 21, 17 and 16 CPU s.
_LARGE = 1400
_LARGE_FOR_EACH = 2.0
# Of a unit displacement of the boundary: what shapes may lose. With 336 pairs 1e-14, 1e-12 and 1e-10 leave 818, 694 and
# 547 of 1008 shapes below the slot (by singular values); 1e-12 changes mass and damping by up to 1e-11 of a diagonal
# entry with 336 pairs.
_LOST = 1e-12
_WORTH = 0.8  # of the shapes: the most that combined shapes may be, to be worth their making
_FEW = 48  # shapes that are not worth being combined
_STEPS = 16  # so many steps to as many combined shapes as there are shapes; 8 or 32 take the time of 16 to 3 %
_PROBES = 8


@dataclass(frozen=True)
class Projection:
    """Forms on the static shapes of a factorised stiffness at a phase."""

    factor: Factor
    forms: Sequence[OrderedForm]
    phase: complex | float

    @cached_property
    def _largest(self) -> IntArray:
        """Displacements (n_fronts,) of the largest boundary of each front and those below it."""
        fronts = self.factor.dissection.fronts
        largest = np.zeros(len(fronts), dtype=np.int64)
        for number, front in enumerate(fronts):
            below = largest[list(front.children)].max(initial=0)
            largest[number] = max(3 * len(front.boundary), below)
        return largest

    def project(self, driven: Dense) -> list[Dense]:
        """Each form (n_shapes, n_shapes) on the shapes with the displacements `driven` (n_kept, n_shapes)."""
        dissection = self.factor.dissection
        # All is done with the conjugate, whose fronts are there in C's order.
        driven = driven.conj()
        totals = [driven.conj().T @ (form.kept(dissection, self.phase).conj() @ driven) for form in self.forms]
        for root in dissection.roots:
            places = dissection.fronts[root].boundary - dissection.n_eliminated
            self._add_child(root, driven[dofs_of(places)], totals)
        return [np.asarray(0.5 * (total + total.conj().T)).conj() for total in totals]

    def condense(self) -> list[Dense]:
        """Each form (n_kept, n_kept) condensed to the nodes that are never eliminated."""
        dissection = self.factor.dissection
        totals = [form.kept(dissection, self.phase) for form in self.forms]
        for root in dissection.roots:
            places = dofs_of(dissection.fronts[root].boundary - dissection.n_eliminated)
            for total, part in zip(totals, self._condensed(root), strict=True):
                total[np.ix_(places, places)] += mirrored(part)
        return totals

    def _add_child(self, number: int, boundary: Dense, totals: list[Dense]) -> None:
        """Adds what a front and those below it have on shapes with displacements `boundary` (n, n_shapes)."""
        few, combined = (boundary, None) if self._largest[number] <= _LARGE else _narrowed(boundary)
        if self._largest[number] <= max(_LARGE, _LARGE_FOR_EACH * few.shape[1]):
            # as a matrix in C's order the lower triangle is the conjugate
            parts = [few.conj().T @ times(mirrored(part).conj(), few) for part in self._condensed(number)]
        else:
            parts = self._on_shapes(number, few)
        for total, part in zip(totals, parts, strict=True):
            total += part if combined is None else combined.conj().T @ (part @ combined)

    def _on_shapes(self, number: int, boundary: Dense) -> list[Dense]:
        """Forms of a front and those below it on shapes with the displacements `boundary` (n, n_shapes)."""
        front, factor = self.factor.dissection.fronts[number], self.factor.fronts[number]
        own = -solve_lower(factor.lower, times(factor.below.T, boundary), transposed=True)
        shapes = np.concatenate([own, boundary])
        totals = []
        for form in self.forms:
            rows = self._rows(form, front, number)
            rows[:, : len(own)] *= 0.5
            half = own.conj().T @ times(sparse.csr_matrix(rows), shapes)
            totals.append(half + half.conj().T)
        for child in front.children:
            places = self.factor.dissection.fronts[child].boundary
            n = int(np.searchsorted(places, front.stop))
            inner = dofs_of(places[:n] - front.first)
            outer = len(own) + dofs_of(np.searchsorted(front.boundary, places[n:]))
            self._add_child(child, shapes[np.concatenate([inner, outer])], totals)
        return totals

    def _condensed(self, number: int) -> list[Dense]:
        """Lower triangles of the forms of a front and those below it, condensed to its boundary."""
        front, factor = self.factor.dissection.fronts[number], self.factor.fronts[number]
        children = [self._condensed(child) for child in front.children]
        shapes = np.asfortranarray(-solve_lower(factor.lower, factor.below.T, transposed=True).conj())
        results = []
        for place, form in enumerate(self.forms):
            rows = self._rows(form, front, number)
            e = len(rows)
            own, below = np.asfortranarray(rows[:, :e].T), np.asfortranarray(rows[:, e:].T)
            update = np.zeros((len(below), len(below)), dtype=rows.dtype, order="F")
            for child, parts in zip(front.children, children, strict=True):
                add_lower(own, below, update, parts[place], places_in_parent(self.factor.dissection, child, number))
            results.append(_condense(own, below, update, shapes))
        return results

    def _rows(self, form: OrderedForm, front: Front, number: int) -> Dense:
        e, f = 3 * (front.stop - front.first), 3 * len(front.boundary)
        return form.rows_of(front, self.phase, np.zeros((e, e + f), dtype=self.factor.fronts[number].lower.dtype))


def _condense(own: Dense, below: Dense, update: Dense, shapes: Dense) -> Dense:
    """`X_ff + T^H X_ef + X_fe T + T^H X_ee T` from lower triangles; shapes T (e, f), all in Fortran's order."""
    if len(update) == 0:
        return update
    if np.iscomplexobj(own):
        forces = blas.zhemm(0.5, own, shapes, beta=1.0, c=np.asfortranarray(below.conj().T), lower=1, overwrite_c=1)
        return np.asarray(blas.zher2k(1.0, shapes, forces, beta=1.0, c=update, trans=2, lower=1, overwrite_c=1))
    forces = blas.dsymm(0.5, own, shapes, beta=1.0, c=np.asfortranarray(below.T), lower=1, overwrite_c=1)
    return np.asarray(blas.dsyr2k(1.0, shapes, forces, beta=1.0, c=update, trans=1, lower=1, overwrite_c=1))


def _narrowed(shapes: Dense) -> tuple[Dense, Dense | None]:
    """`few, combined` with `shapes = few @ combined` to `_LOST`, the rows of `combined` orthonormal.

    None for `combined` where shapes are as few as can be.
    """
    n, n_shapes = shapes.shape
    rng = np.random.default_rng(0)
    probes = rng.standard_normal((n_shapes, _PROBES))
    step = max(_FEW, n_shapes // _STEPS)
    combined = np.zeros((0, n_shapes), dtype=shapes.dtype)
    while len(combined) + step <= _WORTH * n_shapes:
        # rows of the shapes, those that are known taken out of them: twice, for round-off
        sample = rng.standard_normal((step, n)) @ shapes
        for _ in range(2):
            sample -= (sample @ combined.conj().T) @ combined
            sample = qr(sample.conj().T, mode="economic", overwrite_a=True, check_finite=False)[0].conj().T
        combined = np.concatenate([combined, sample])
        probes = probes - sample.conj().T @ (sample @ probes)
        if np.abs(shapes @ probes).max() <= _LOST * np.sqrt(n_shapes):
            return np.ascontiguousarray(shapes @ combined.conj().T), combined
    return shapes, None
