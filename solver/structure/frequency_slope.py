"""Change of the condensed structure with the frequency, at given relative displacements.

With the dynamic stiffness A = K + i n w C - (n w)^2 M of harmonic n, its change `A' = i n C - 2 n^2 w M` with the
frequency w, and all displacements x under given relative displacements u, split into those of the pairs (r) and all
others (i),

    x_i' = -A_ii^-1 (A' x)_i,      (Z_r u - F_r)' = (A' x)_r + A_ri x_i'.

A difference of two condensations would have to be short: behind a joint that sticks the structure has its resonance
close to the one that is followed, and there A_ii is nearly singular.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import cast

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
    n_rel, moving = relative.size, to_complex(displacement_h).T
    force, product = np.zeros((n_rel, len(orders)), complex), 0.0 + 0.0j
    response = np.zeros(model.linear[0].response.shape[0], complex)
    for (linear, conjugate), places in by_structure(model, orders):
        every = relative_first(len(linear.mass), relative)
        mass, damping, elastic, shape, rows = (
            (part.conj() if conjugate else part)[..., every]
            for part in (linear.mass, linear.damping, linear.stiffness, linear.load_harmonic, linear.response)
        )
        mass, damping, elastic = (part[every] for part in (mass, damping, elastic))
        harmonics = np.array(orders)[places]
        rates = omega * harmonics
        behind = dynamic_stiffness(elastic[n_rel:], damping[n_rel:], mass[n_rel:], rates)
        compliance = cast("ComplexArray", np.linalg.inv(behind[..., n_rel:]))
        load = np.where(harmonics[:, None] == 1, excitation_amplitude, 0.0) * shape
        pushed = load[:, n_rel:] - _each(behind[..., :n_rel], moving[places])
        x = np.concatenate([moving[places], _each(compliance, pushed)], axis=1)
        number = harmonics[:, None]
        slope = 1j * number * (x @ damping.T) - 2.0 * number**2 * omega * (x @ mass.T)
        turned = -_each(compliance, slope[:, n_rel:])
        rate = rates[:, None]
        elastic, damping, mass = (turned @ part[:n_rel, n_rel:].T for part in (elastic, damping, mass))
        force[:, places] = (slope[:, :n_rel] + elastic + 1j * rate * damping - rate**2 * mass).T
        if harmonics[0] == 1:
            product, response = complex(load[0, n_rel:].conj() @ turned[0]), rows[:, n_rel:] @ turned[0]
    return FrequencySlope(from_complex(np.zeros(n_rel), force), product, response)


def _each(matrices: ComplexArray, vectors: ComplexArray) -> ComplexArray:
    """Products (H, n) of matrices (H, n, m) with vectors (H, m)."""
    return cast("ComplexArray", np.matmul(matrices, vectors[:, :, None])[:, :, 0])
