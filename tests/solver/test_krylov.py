"""Krylov methods against dense solves."""

import numpy as np
import pytest

from solver.newton.krylov import STAGNATION_PRODUCTS, solve_gmres


def counted(matrix):
    count = [0]

    def product(vector):
        count[0] += 1
        return matrix @ vector

    return count, product


def well_conditioned(size, seed):
    random = np.random.default_rng(seed)
    return np.eye(size) + 0.4 * random.normal(size=(size, size)) / np.sqrt(size)


@pytest.mark.parametrize(("restart", "cycles"), [(60, 1), (6, 20)])
def test_it_finds_the_solution_with_and_without_beginning_again(restart, cycles):
    matrix = well_conditioned(60, 1)
    right = np.random.default_rng(2).normal(size=60)
    exact = np.linalg.solve(matrix, right)
    found, converged = solve_gmres(lambda x: matrix @ x, right, 1e-10, restart, cycles)
    assert converged
    assert np.linalg.norm(matrix @ found - right) <= 1e-10 * np.linalg.norm(right)
    assert np.linalg.norm(found - exact) < 1e-8 * np.linalg.norm(exact)


def test_a_singular_operator_gives_what_can_be_had_and_ends():
    # J with a null vector on either side, and a right-hand side that it does not reach
    random = np.random.default_rng(6)
    left, null = (part / np.linalg.norm(part) for part in random.normal(size=(2, 100)))
    matrix = well_conditioned(100, 7)
    matrix = matrix - np.outer(left, left @ matrix)
    matrix = matrix - np.outer(matrix @ null, null)
    reached = matrix @ random.normal(size=100)
    right = reached / np.linalg.norm(reached) + 0.3 * left
    count, product = counted(matrix)
    found, converged = solve_gmres(product, right, 1e-3, 80, 6)  # type: ignore[arg-type]
    assert not converged
    assert np.linalg.norm(found) < 100.0
    # next to nothing but what lies out of reach is left
    assert 0.3 <= np.linalg.norm(matrix @ found - right) < 0.6
    assert count[0] < 3 * STAGNATION_PRODUCTS
    # the part that it reaches is no harder than with any other operator
    assert solve_gmres(lambda x: matrix @ x, reached, 1e-6, 60, 1)[1]


def test_nothing_is_the_solution_of_nothing_and_what_is_not_finite_ends():
    zero = np.zeros(5)
    found, converged = solve_gmres(lambda x: x, zero, 1e-3, 5, 2)
    assert converged
    assert np.array_equal(found, zero)
    assert not solve_gmres(lambda x: x * np.nan, np.ones(5), 1e-3, 5, 2)[1]


def test_products_that_are_rounded_are_refined_by_exact_ones():
    random = np.random.default_rng(3)
    # a direction that moves far under a small force
    left, right = (np.linalg.qr(random.normal(size=(30, 30)))[0] for _ in range(2))
    matrix = (left * np.geomspace(1.0, 1e-7, 30)) @ right
    wanted = matrix @ random.normal(size=30)
    rounded = matrix.astype(np.float32)
    plain, found = solve_gmres(lambda x: rounded @ x, wanted, 1e-9, 30, 1)
    assert np.linalg.norm(matrix @ plain - wanted) > 1e-9 * np.linalg.norm(wanted)
    solution, found = solve_gmres(lambda x: rounded @ x, wanted, 1e-9, 30, 1, lambda x: matrix @ x)
    assert found
    assert np.linalg.norm(matrix @ solution - wanted) < 1e-9 * np.linalg.norm(wanted)
