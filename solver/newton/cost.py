"""Predicted times of the ways to solve a Jacobian, from counts alone, so that the choice is equal on all machines.

With n unknowns in n_rel rows, m = 2H + 1 harmonics and k directions of slip and separation:

- dense: matrix of the n unknowns, and its factorisation;
- slip space (`slip_preconditioner`): orthonormal bases of the pairs, matrix of the k directions, its factorisation;
- march (`period_preconditioner`): one small system at each sample, and the d directions in which the harmonics differ.

A kept factorisation takes some products for each solve. The predictions were within a factor of 1.6 of the times of
16 joints (1 to 48 pairs, 1 to 100 harmonics, 90 to 3300 directions) where these are above 1 ms.
"""

from __future__ import annotations

import numpy as np

from solver.contact.coulomb import STICK
from solver.harmonic_balance.dlft import Linearisation
from solver.model import FloatArray
from solver.newton.options import NEWTON
from solver.newton.period_preconditioner import fewest_samples, resonances


def is_dense_cheapest(n: int, n_rel: int) -> bool:
    """Whether a dense solve takes no longer than a solve with a kept factorisation."""
    flops = n**3 / 1.5 + 4.0 * n**2 * n_rel
    return flops / NEWTON.flop_rate + 16.0 * n**2 / NEWTON.vector_rate <= NEWTON.usual_products * _product_time(0)


def worthwhile_products(n_pairs: int, m: int, k: int) -> int:
    """Products that take as long as a new factorisation of k directions."""
    new = float(_slip_time(n_pairs, m, np.array(float(k))))
    return int(np.clip(new / _product_time(k), NEWTON.usual_products, NEWTON.products))


def worthwhile_directions(tangent: Linearisation) -> int:
    """Largest number of directions whose exact factorisation takes no longer than the march with its products."""
    joint, most = tangent.joint, NEWTON.most_directions
    if joint.penalty.inertial.any():
        return most
    pairs = tangent.active()
    m = joint.basis.synthesis.shape[0]
    exact = _slip_time(pairs.size, m, np.arange(most + 1.0))
    n = 3 * pairs.size * m
    if n <= most and exact[n] <= _march_time(tangent, 0):
        return n
    return int(np.count_nonzero(exact <= _march_time(tangent, len(resonances(joint)[0])))) - 1


def _product_time(size: int) -> float:
    """Time, s, of a product with the Jacobian and a solve with a factorisation of `size` directions."""
    return 10.0 * NEWTON.call_time + 2.0 * size**2 / NEWTON.vector_rate


def _slip_time(n_pairs: int, m: int, k: FloatArray) -> FloatArray:
    """Times, s, of exact factorisations in k directions (...,)."""
    flops = k**3 / 1.5 + 6.0 * m * k**2 + 4.0 * n_pairs * (3 * m) ** 3
    return np.asarray(flops / NEWTON.flop_rate + 3.0 * n_pairs * NEWTON.call_time)


def _march_time(tangent: Linearisation, d: int) -> float:
    """Time, s, of the march with d directions in which the harmonics differ, and of a solve with the march."""
    joint, pairs = tangent.joint, tangent.active()
    n_samples, n = fewest_samples(joint.basis), joint.component_index.size * joint.basis.synthesis.shape[0]
    # rows of the system of a sample: two for a pair that slips, up to three for an open one
    rows = 2.0 * float((tangent.at.status_t[pairs] != STICK).sum()) / joint.basis.n_samples
    solve = 10.0 * NEWTON.call_time
    solve += (4.0 * n_samples * rows * (rows + 2.0 * pairs.size) + 4.0 * d * n) / NEWTON.vector_rate
    build = n_samples * (5.0 * NEWTON.call_time + 2.0 * rows**3 / NEWTON.flop_rate) + 2.0 * d**2 * n / NEWTON.flop_rate
    return build + (d + NEWTON.usual_products) * solve
