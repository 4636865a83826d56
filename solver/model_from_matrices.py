"""A reduced model from matrices and contact pairs in Python, for use without scene files."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from solver.model import (
    ContactInterface,
    FloatArray,
    IntArray,
    LinearModel,
    PairLaw,
    ReducedModel,
    needed_nodal_diameters,
)
from solver.outcome import check

OfWaves = ArrayLike | Mapping[int, ArrayLike]


def find_asymmetry(matrix: Any, tolerance: float = 1e-8) -> tuple[int, int] | None:
    """Row and column of the entry that differs most from its mirror image; None of a Hermitian matrix.

    matrix (n, n): dense or sparse. tolerance: of a difference over the geometric mean of both entries of the diagonal,
    which bounds an entry of a positive semidefinite matrix: displacements and modal coordinates have different units.
    Beside round-off of the largest entry, an entry of the diagonal is none.
    """
    n, largest = matrix.shape[0], float(abs(matrix).max())
    if largest == 0.0:
        return None
    round_off = max(n, 10) * np.finfo(np.float64).eps * largest
    bound = np.sqrt(np.maximum(abs(matrix.diagonal()), round_off / tolerance))
    scale = sparse.diags_array(1.0 / bound)
    difference = abs(scale @ (matrix - matrix.conj().T) @ scale)
    row, column = divmod(int(difference.argmax()), n)
    return None if difference[row, column] <= tolerance else (row, column)


def build_model(
    mass: OfWaves,
    damping: OfWaves | None,
    stiffness: OfWaves,
    contact_dofs: ArrayLike,
    area: ArrayLike,
    *,
    load_harmonic: ArrayLike,
    load_static: ArrayLike | None = None,
    response: OfWaves | None = None,
    gap: ArrayLike = 0.0,
    normal_load: ArrayLike = 0.0,
    position: ArrayLike | None = None,
    surface: Sequence[str] | None = None,
    response_names: Sequence[str] | None = None,
    n_sectors: int = 0,
    nodal_diameter: int = 0,
    laws: Sequence[PairLaw] = (),
) -> ReducedModel:
    """A structure `M x'' + C x' + K x + (contact forces) = load` and the contact pairs on it.

    The *relative* displacements of the pairs (blade minus disk; closing displacements positive when the pair closes)
    are components of x. Of a cyclic sector under a travelling wave of nodal diameter d, mass, damping, stiffness and
    response are tables `{k: matrix}`: harmonic n moves in nodal diameter n d, folded into 0..n_sectors // 2. At nodal
    diameter k a pair with the next sector has the relative displacement `u - exp(2 pi i k / N) R u_that`, where R turns
    by one sector; the indices of all pairs are the same at each k.

    - mass, damping, stiffness (n, n): kg, N s/m, N/m; symmetric, or Hermitian at nodal diameters above 0. damping: None
      for none.
    - contact_dofs (n_contact, 3) int: index in x of the closing, the first and the second tangential relative
      displacement of each pair; -1 where the pair has no such displacement.
    - area, gap, normal_load (n_contact,) or one number: weight alpha of Eq. (7), m2; initial gap, m; constant normal
      force of pairs without a closing displacement, N, compression positive.
    - load_harmonic (n,): complex, N per unit excitation amplitude, load(t) = Re(F exp(i omega t)), at nodal diameter d.
      load_static (n,): N, at nodal diameter 0.
    - response: indices (n_response,) of x, or a matrix (n_response, n). All of x if not given.
    - position (n_contact, 3), m, surface, response_names: labels that do not change the results.
    - n_sectors, nodal_diameter: of the cyclic structure and of the wave, 0 to n_sectors - 1; 0 for no sector.
    - laws: of pairs that do not rub and open, as `CubicSprings` and `IwanJoints`.

    Raises ValueError where shapes do not fit, a number is not finite, a nodal diameter is missing, a matrix is not
    symmetric or Hermitian, an area is not positive, an index is out of range or used twice, or nothing presses a pair.
    """
    waves = stiffness if isinstance(stiffness, Mapping) else {0: stiffness}
    check("nodal_diameter", 0 <= nodal_diameter < max(n_sectors, 1), "give 0 to n_sectors - 1")
    for k in needed_nodal_diameters(nodal_diameter, n_sectors, 1):
        check("stiffness", k in waves, f"give the matrix of nodal diameter {k}")
    excited = min(nodal_diameter, n_sectors - nodal_diameter) if nodal_diameter else 0
    tables = {"stiffness": waves, "mass": mass, "damping": damping, "response": response}
    linear = {
        k: _linear(k, tables, load_static if k == 0 else None, load_harmonic if k == excited else None) for k in waves
    }
    dofs = _array("contact_dofs", contact_dofs, (-1, 3))
    dofs = _indices("contact_dofs", dofs, -1, min(len(each.stiffness) for each in linear.values()))
    used, n_contact, n_response = dofs[dofs >= 0], len(dofs), len(linear[0].response)
    check("contact_dofs", len(np.unique(used)) == used.size, "give each displacement to one pair only")
    check("contact_dofs", n_contact > 0 and (dofs >= 0).any(axis=1).all(), "give every pair a displacement")
    nowhere = np.full((n_contact, 3), np.nan)
    contact = ContactInterface(
        dofs=dofs,
        area=_array("area", area, (n_contact,), repeat=True),
        gap=_array("gap", gap, (n_contact,), repeat=True),
        normal_load=_array("normal_load", normal_load, (n_contact,), repeat=True),
        position=nowhere if position is None else _array("position", position, nowhere.shape),
        surface=_names("surface", ("",) * n_contact if surface is None else surface, n_contact),
        laws=tuple(laws),
    )
    check("area", (contact.area > 0.0).all(), "give a positive area, m2, to every contact pair")
    for pair in np.flatnonzero(contact.rubs & ~contact.has_normal & (contact.normal_load <= 0.0))[:1]:
        check("normal_load", False, f"give pair {pair} more than 0 N, as it has no closing displacement to press it")
    default_names = [f"response {index}" for index in range(n_response)]
    names = _names("response_names", default_names if response_names is None else response_names, n_response)
    return ReducedModel(linear, contact, names, n_sectors, nodal_diameter)


def _linear(
    k: int, tables: Mapping[str, OfWaves | None], load_static: ArrayLike | None, load_harmonic: ArrayLike | None
) -> LinearModel:
    """The structure at nodal diameter k, from what is given for each nodal diameter or for all of them."""
    given: dict[str, Any] = {}
    for name, table in tables.items():
        if isinstance(table, Mapping):
            check(name, k in table, f"give it for nodal diameter {k}, as the stiffness")
        given[name] = table[k] if isinstance(table, Mapping) else table
    real, n = k == 0, len(np.atleast_1d(_array("stiffness", given["stiffness"], None, real=k == 0)))
    nothing, matrices = np.zeros(n), {}
    for name in ("stiffness", "mass", "damping"):
        found = _array(name, np.zeros((n, n)) if given[name] is None else given[name], (n, n), real=real)
        if places := find_asymmetry(found):
            kind = "symmetric" if real else "Hermitian"
            check(name, False, f"give a {kind} matrix: the entries at {places} and {places[::-1]} differ")
        matrices[name] = found
    # matrix (n_response, n) of the responses, from a matrix or from indices
    response = np.eye(n) if given["response"] is None else _array("response", given["response"], None, real=real)
    response = np.eye(n)[_indices("response", response, 0, n)] if response.ndim == 1 else response
    check("response", len(response) > 0, "give at least one displacement")
    static, harmonic = (nothing if load is None else load for load in (load_static, load_harmonic))
    return LinearModel(
        **matrices,
        load_static=_array("load_static", static, (n,)),
        load_harmonic=_array("load_harmonic", harmonic, (n,), real=False).astype(np.complex128),
        response=_shaped("response", response, (-1, n)),
    )


def _array(
    name: str, given: ArrayLike, shape: tuple[int, ...] | None, *, real: bool = True, repeat: bool = False
) -> Any:
    """A copy as an array of finite numbers; shape as in `_shaped`; repeat: whether one number stands for all."""
    try:
        found = np.array(given)
    except ValueError:
        raise ValueError(f"{name}: give rows of equal length") from None
    check(name, found.dtype.kind in "iufc", "give numbers")
    # matrices that are real often come as complex ones
    check(name, not (real and np.imag(found).any()), "give real numbers")
    found = found.real.astype(np.float64) if real or found.dtype.kind != "c" else found.astype(np.complex128)
    check(name, np.isfinite(found).all(), "give finite numbers")
    if shape is None:
        return found
    return np.full(shape, found) if repeat and found.ndim == 0 else _shaped(name, found, shape)


def _shaped(name: str, found: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    """The array, of a shape in which -1 stands for any length."""
    fits = found.ndim == len(shape) and all(want in (-1, size) for want, size in zip(shape, found.shape, strict=True))
    check(name, fits, f"give shape {shape} instead of {found.shape}".replace("(-1,", "(any number,"))
    return found


def _indices(name: str, found: FloatArray, least: int, n: int) -> IntArray:
    right = (found == np.round(found)) & (found >= least) & (found < n)
    check(name, right.all(), f"give whole numbers from {least} to {n - 1}")
    return found.astype(np.int64)


def _names(name: str, given: Sequence[str], number: int) -> tuple[str, ...]:
    found = tuple(str(each) for each in given)
    check(name, len(found) == number and not isinstance(given, str), f"give {number} texts")
    return found
