"""Static condensation: a structure with fewer displacements, the others following from these."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple, cast

import numpy as np

from solver.model import ComplexArray, IntArray, LinearModel, Matrix


def dynamic_stiffness(linear: LinearModel, exponent: complex | ComplexArray, at: Any) -> ComplexArray:
    """Entries `at` of `K + s C + s^2 M`, N/m, for motions exp(s t); exponent: s, 1/s."""
    stiffness = linear.stiffness[at] + exponent * linear.damping[at] + exponent**2 * linear.mass[at]
    return cast("ComplexArray", stiffness)


class SingularStructureError(np.linalg.LinAlgError):
    """The structure with a stuck joint is singular; no other failure of linear algebra is called so."""


@contextmanager
def regular(where: str) -> Iterator[None]:
    """Says that it is the structure that is singular in what follows; where: at which frequency."""
    try:
        yield
    except np.linalg.LinAlgError as error:
        raise SingularStructureError(f"the matrix of the structure is singular {where}") from error


class Condensed(NamedTuple):
    """A structure reduced to the relative displacements u (n_rel,).

    - stiffness (n_rel, n_rel): Schur complement, N/m. force (n_rel,): reduced load, N.
    - rows (k, n_rel), offset (k,): `rows u + offset` is what the given rows make of all displacements.
    """

    stiffness: Matrix
    force: Matrix
    rows: Matrix
    offset: Matrix


def condense(full: Matrix, relative: IntArray, load: Matrix, rows: Matrix | None = None) -> Condensed:
    """Condensation of a stiffness (n, n), N/m, a load (n,), N, and rows (k, n), with equal leading axes if any.

    Raises numpy.linalg.LinAlgError where the block of the other displacements is singular.
    """
    others = np.setdiff1d(np.arange(full.shape[-1]), relative)
    seen = np.zeros((*full.shape[:-2], 0, full.shape[-1])) if rows is None else rows
    to_pairs, to_others = full[..., relative, :], full[..., others, :]
    # the other displacements per u, with the sign reversed, and under the load with u = 0
    right = np.concatenate([to_others[..., relative], load[..., others, None]], axis=-1)
    behind = cast("Matrix", np.linalg.solve(to_others[..., others], right))
    back, by_others = to_pairs[..., others] @ behind, seen[..., others] @ behind
    return Condensed(
        to_pairs[..., relative] - back[..., :-1],
        load[..., relative] - back[..., -1],
        seen[..., relative] - by_others[..., :-1],
        by_others[..., -1],
    )
