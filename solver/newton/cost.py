"""Predicted costs of the ways to solve a Jacobian, from counts alone, so that the choice is equal on all machines.

With n unknowns in n_rel rows, m = 2H + 1 harmonics and k directions of slip and separation:

- dense: matrix of the n unknowns, and its factorisation;
- slip space (`slip_preconditioner`): orthonormal bases of the pairs, matrix of the k directions, its factorisation;
- march (`period_preconditioner`): one small system at each sample, and the d directions in which the harmonics differ.

A kept factorisation takes some products for each solve. Costs are in operations of a factorisation.
`python -m tests.benchmarks.solve_costs` compares costs with times.
"""

from __future__ import annotations

from bisect import bisect_right

from solver.contact.coulomb import STICK
from solver.harmonic_balance.dlft import Linearisation
from solver.newton.options import NEWTON
from solver.newton.period_preconditioner import fewest_samples, resonances


def is_dense_cheapest(n: int, n_rel: int) -> bool:
    """Whether a dense solve takes no longer than a solve with a kept factorisation."""
    return dense_cost(n, n_rel) <= NEWTON.usual_products * product_cost(0)


def worthwhile_products(n_pairs: int, m: int, k: int) -> int:
    """Products that take as long as a new factorisation of k directions."""
    worth = int(slip_cost(n_pairs, m, k) / product_cost(k))
    return min(max(worth, NEWTON.usual_products), NEWTON.products)


def worthwhile_directions(tangent: Linearisation) -> int:
    """Largest number of directions whose exact factorisation takes no longer than the march with its products.

    A small joint and one with sliding masses have no choice: the march is no good for them.
    """
    joint, most = tangent.joint, NEWTON.most_directions
    small = joint.component_index.size <= NEWTON.small_joint_displacements
    if small or joint.law.rate_dependent:
        return most
    n_pairs, m = tangent.active().size, joint.basis.synthesis.shape[0]
    n = 3 * n_pairs * m
    # the directions in which the harmonics differ are only computed where they matter
    if n <= most and slip_cost(n_pairs, m, n) <= march_cost(tangent, 0):
        return int(n)
    march = march_cost(tangent, len(resonances(joint)[0]))
    return bisect_right(range(most + 1), march, key=lambda k: slip_cost(n_pairs, m, k)) - 1


def dense_cost(n: int, n_rel: int) -> float:
    """Cost of the matrix and its factorisation."""
    return n**3 / 1.5 + 4.0 * n**2 * n_rel + 16.0 * n**2 * NEWTON.vector_cost


def product_cost(size: int) -> float:
    """Cost of a product with the Jacobian and a solve with a factorisation of `size` directions."""
    return 10.0 * NEWTON.call_cost + 2.0 * size**2 * NEWTON.vector_cost


def slip_cost(n_pairs: int, m: int, k: int) -> float:
    """Cost of an exact factorisation in k directions."""
    return k**3 / 1.5 + 6.0 * m * k**2 + n_pairs * (4.0 * (3 * m) ** 3 + 3.0 * NEWTON.call_cost)


def march_cost(tangent: Linearisation, d: int) -> float:
    """Cost of the march with d directions in which the harmonics differ, and of a solve with the march."""
    joint, pairs = tangent.joint, tangent.active()
    n_samples, n = fewest_samples(joint.basis), joint.component_index.size * joint.basis.synthesis.shape[0]
    # rows of the system of a sample: two for a pair that slips, up to three for an open one
    rows = 2.0 * int((tangent.at.status_t[pairs] != STICK).sum()) / joint.basis.n_samples
    march = 10.0 * NEWTON.call_cost + 4.0 * n_samples * rows * (rows + 2.0 * pairs.size) * NEWTON.vector_cost
    build = n_samples * (5.0 * NEWTON.call_cost + 2.0 * rows**3) + d * march + 2.0 * d**2 * n
    return float(build + NEWTON.usual_products * (march + 4.0 * d * n * NEWTON.vector_cost))
