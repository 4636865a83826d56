"""Change of the condensed structure with the frequency, at given relative displacements.

With the dynamic stiffness A = K + i n w C - (n w)^2 M of harmonic n, its change `A' = i n C - 2 n^2 w M` with the
frequency w, and all displacements x under given relative displacements u, split into those of the pairs (r) and all
others (i),

    x_i' = -A_ii^-1 (A' x)_i,      (Z_r u - F_r)' = (A' x)_r + A_ri x_i'.

A difference of two condensations is not accurate: behind a joint that sticks A_ii is nearly singular close to the
resonance that is followed.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from solver.model import ComplexArray, FloatArray, ReducedModel
from solver.structure.condensation import by_structure, dynamic_stiffness, relative_first, relative_indices
from solver.structure.fourier import from_complex, to_complex


@dataclass(frozen=True)
class FrequencySlope:
    """Derivatives with respect to the frequency at given relative displacements u and contact forces.

    - force (n_rel, 2H+1): of `Z_r u - F_r`, N s/rad.
    - product: of `F^H x` in harmonic 1, N m s/rad.
    - response (n_response,): complex, of the responses in harmonic 1, m s/rad.
    """

    force: FloatArray
    product: complex
    response: ComplexArray


def frequency_slope(
    model: ReducedModel,
    omega: float,
    excitation_amplitude: float,
    orders: tuple[int, ...],
    displacement_h: FloatArray,
) -> FrequencySlope:
    """Change of a structure with the frequency; arguments as in `build_structure`, and u (n_rel, 2H+1), m."""
    relative, _ = relative_indices(model.contact)
    others = relative_first(len(model.linear[0].mass), relative)[relative.size :]
    moving = to_complex(displacement_h).T
    force, product = np.zeros((relative.size, len(orders)), complex), 0.0 + 0.0j
    response = np.zeros(model.linear[0].response.shape[0], complex)
    for linear, places in by_structure(model, orders):
        harmonics = np.array(orders)[places]
        rates, number = omega * harmonics, harmonics[:, None]
        load = np.where(number == 1, excitation_amplitude, 0.0) * linear.load_harmonic
        behind = dynamic_stiffness(linear, rates, others, others)
        x = np.empty((len(places), len(linear.mass)), complex)
        x[:, relative] = moving[places]
        pushed = load[:, others] - _each(np.matmul, dynamic_stiffness(linear, rates, others, relative), moving[places])
        x[:, others] = _each(np.linalg.solve, behind, pushed)
        slope = 1j * number * (x @ linear.damping.T) - 2.0 * number**2 * omega * (x @ linear.mass.T)
        turned = -_each(np.linalg.solve, behind, slope[:, others])
        force[:, places] = (
            slope[:, relative] + _each(np.matmul, dynamic_stiffness(linear, rates, relative, others), turned)
        ).T
        if harmonics[0] == 1:
            product, response = complex(load[0, others].conj() @ turned[0]), linear.response[:, others] @ turned[0]
    return FrequencySlope(from_complex(np.zeros(relative.size), force), product, response)


def _each(of: Callable[[ComplexArray, ComplexArray], Any], matrices: ComplexArray, vectors: ComplexArray) -> Any:
    """Products or solutions (H, n) of matrices (H, n, m) with vectors (H, m)."""
    return of(matrices, vectors[:, :, None])[:, :, 0]
