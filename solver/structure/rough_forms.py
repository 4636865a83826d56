"""The condensed dynamic stiffness Z_r in single precision, for fast products of three digits.

Three digits are enough for directions of Newton's method. The time of a product is the time of reading the matrices
from memory. In a real structure all harmonics share the stiffness K of the displacements of the pairs. The mass M, and
the part of the damping C that is not proportional to stiffness, `C - s K`, need only few motions of the joint. The
structure behind the joint acts through as many motions as it has displacements. With a basis B of all these motions

    Z_n = (1 + i n w s) K + B G_n B^T,      G_n small and complex,

and one product with K serves all harmonics. Other structures need a matrix for each harmonic.

CPU time of an adaptive history of the dovetail with products in double precision, over that with these: 1.08 (16 and
48 pairs), 2.15 (336 pairs).
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from solver.model import ComplexArray, FloatArray, IntArray, LinearModel

ROUGH_DIRECTIONS = 48
"""Largest number of motions that carry mass, and damping not proportional to stiffness, in rough products."""

ROUGH = 1e-3
"""Part of the stiffness that a rough product may leave out. Does not change results."""

_NO_MATRICES = np.empty((0, 0, 0), np.complex64)
SingleArray = NDArray[np.float32]
SingleComplex = NDArray[np.complex64]


class RoughStiffness(NamedTuple):
    """Z_r at H harmonics above the static one, in single precision.

    - each (H, n_rel, n_rel): a matrix for each harmonic, N/m; or (0, 0, 0), and then the other fields are used:
    - shared (n_rel, n_rel): K, N/m.
    - drag (H,): `n w s`, dimensionless.
    - basis (n_rel, k), basis_t (k, n_rel): B and its transpose, orthonormal.
    - core (H, k, k): G_n, N/m.
    """

    each: SingleComplex
    shared: SingleArray
    drag: SingleArray
    basis: SingleArray
    basis_t: SingleArray
    core: SingleComplex


def rough_of_each(dense: ComplexArray) -> RoughStiffness:
    """Rough form with a matrix for each harmonic, from `dense` (H, n_rel, n_rel), N/m."""
    none = np.empty((0, 0), np.float32)
    return RoughStiffness(np.ascontiguousarray(dense, np.complex64), none, none.ravel(), none, none, _NO_MATRICES)


def rough_of_shared(
    linear: LinearModel, relative: IntArray, internal: IntArray, rates: FloatArray, held_compliance: ComplexArray
) -> RoughStiffness | None:
    """Rough form of a real structure at the rates n w (H,), rad/s; None where the form would leave out too much.

    held_compliance (H, n_i, n_i): compliance of the displacements `internal` (n_i,) with the pairs held, m/N.
    """
    common = _common_form(linear, tuple(relative.tolist()))
    highest = float(rates.max(initial=0.0))
    left_out = highest**2 * common.mass_left_out + highest * common.drag_left_out
    if left_out > ROUGH * common.size:
        return None
    rate = rates[:, None, None]
    parts = (linear.stiffness, linear.mass, linear.damping)
    spring, inertia, drag = (common.basis.T @ np.real(part)[relative[:, None], internal] for part in parts)
    coupling = spring - rate**2 * inertia + 1j * rate * drag
    core = 1j * rate * common.drag - rate**2 * common.mass
    core = core - coupling @ held_compliance @ coupling.transpose(0, 2, 1)
    basis = np.ascontiguousarray(common.basis, np.float32)
    slope, basis_t = (rates * common.slope).astype(np.float32), np.ascontiguousarray(basis.T)
    return RoughStiffness(
        _NO_MATRICES, common.stiffness, slope, basis, basis_t, np.ascontiguousarray(core, np.complex64)
    )


class _CommonForm(NamedTuple):
    """Data that the rough forms of a structure share at all frequencies.

    - stiffness (n_rel, n_rel): K, N/m.
    - slope: the factor s in `C = s K + ...`, s.
    - basis (n_rel, k): B.
    - mass, drag (k, k): M and `C - s K` in the basis.
    - mass_left_out, drag_left_out: Frobenius norms of the parts of mass and drag that the basis leaves out.
    - size: root mean square of the eigenvalues of K, N/m.
    """

    stiffness: SingleArray
    slope: float
    basis: FloatArray
    mass: FloatArray
    drag: FloatArray
    mass_left_out: float
    drag_left_out: float
    size: float


@lru_cache(maxsize=2)
def _common_form(linear: LinearModel, relative: tuple[int, ...]) -> _CommonForm:
    rows = np.array(relative, np.intp)
    internal = np.setdiff1d(np.arange(len(linear.mass)), rows)
    parts = [np.asarray(np.real(part), np.float64) for part in (linear.stiffness, linear.mass, linear.damping)]
    stiffness, mass, damping = (part[rows[:, None], rows] for part in parts)
    norm = float(np.linalg.norm(stiffness))
    slope = float(np.vdot(stiffness, damping)) / norm**2 if norm > 0.0 else 0.0
    drag = damping - slope * stiffness
    directions = [_leading(mass, ROUGH_DIRECTIONS)]
    if np.linalg.norm(drag) > 1e-6 * slope * norm:
        directions.append(_leading(drag, ROUGH_DIRECTIONS))
    directions += [_leading(part[rows[:, None], internal], internal.size) for part in parts]
    left, sizes, _ = np.linalg.svd(np.hstack(directions), full_matrices=False)
    basis = left[:, sizes > 1e-6]
    small_mass, small_drag = basis.T @ mass @ basis, basis.T @ drag @ basis
    return _CommonForm(
        np.ascontiguousarray(stiffness, np.float32),
        slope,
        basis,
        small_mass,
        small_drag,
        float(np.linalg.norm(mass - basis @ small_mass @ basis.T)),
        float(np.linalg.norm(drag - basis @ small_drag @ basis.T)),
        norm / np.sqrt(max(rows.size, 1)),
    )


def _leading(matrix: FloatArray, most: int) -> FloatArray:
    """Orthonormal columns that span the largest part of the range of a matrix; none where the matrix is zero."""
    left, sizes, _ = np.linalg.svd(matrix, full_matrices=False)
    return left[:, :most][:, sizes[:most] > 1e-12 * sizes.max(initial=0.0)]


@njit(cache=True)
def multiply_roughly(static: FloatArray, rough: RoughStiffness, motion: FloatArray) -> FloatArray:
    """Forces `Z_r u` (n_rel, 2H+1), N, to at least three digits, from a motion u (n_rel, 2H+1), m.

    static (n_rel, n_rel): static stiffness, N/m, in double precision, because a joint that slides as a whole moves far.
    """
    n_rel, m = motion.shape
    n_harmonics = (m - 1) // 2
    force = np.empty((n_rel, m))
    force[:, 0] = np.dot(static, np.ascontiguousarray(motion[:, 0]))
    if len(rough.each) == n_harmonics:
        amplitude = np.empty(n_rel, np.complex64)
        for n in range(n_harmonics):
            for row in range(n_rel):
                amplitude[row] = complex(motion[row, 2 * n + 1], -motion[row, 2 * n + 2])
            pushed = np.dot(rough.each[n], amplitude)
            for row in range(n_rel):
                force[row, 2 * n + 1] = pushed[row].real
                force[row, 2 * n + 2] = -pushed[row].imag
        return force
    # motions of 1e-6 m and stiffnesses of 1e9 N/m are well within the range of single precision
    moving = motion[:, 1:].astype(np.float32)
    spring, seen = np.dot(rough.shared, moving), np.dot(rough.basis_t, moving)
    bent = np.empty_like(seen)
    amplitude = np.empty(len(seen), np.complex64)
    for n in range(n_harmonics):
        for row in range(len(seen)):
            amplitude[row] = complex(seen[row, 2 * n], -seen[row, 2 * n + 1])
        pushed = np.dot(rough.core[n], amplitude)
        for row in range(len(seen)):
            bent[row, 2 * n], bent[row, 2 * n + 1] = pushed[row].real, -pushed[row].imag
    back = np.dot(rough.basis, bent)
    for row in range(n_rel):
        for n in range(n_harmonics):
            # (1 + i d) (cosine - i sine) = cosine + d sine - i (sine - d cosine)
            cosine, sine, drag = spring[row, 2 * n], spring[row, 2 * n + 1], rough.drag[n]
            force[row, 2 * n + 1] = cosine + drag * sine + back[row, 2 * n]
            force[row, 2 * n + 2] = sine - drag * cosine + back[row, 2 * n + 1]
    return force
