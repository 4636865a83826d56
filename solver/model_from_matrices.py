"""A reduced model from matrices and contact pairs in Python, for use without scene files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from solver.model import (
    ComplexArray,
    ContactInterface,
    FloatArray,
    IntArray,
    LinearModel,
    Matrix,
    ReducedModel,
    needed_nodal_diameters,
)

OfWaves = ArrayLike | Mapping[int, ArrayLike]

_SYMMETRIC = 1e-8  # relative to the largest entry: round-off of a matrix that was reduced or read from a text file


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
) -> ReducedModel:
    """A structure `M x'' + C x' + K x + (contact forces) = load` and the contact pairs on it.

    The *relative* displacements of the pairs (blade minus disk; closing displacements positive when the pair closes)
    are components of x, as after a change of coordinates and a reduction to `[u_rel | other]`.

    Of a cyclic sector under a travelling wave of nodal diameter d, mass, damping, stiffness and response are tables
    `{k: matrix}`: harmonic n moves in nodal diameter n d, folded into 0..n_sectors // 2. At nodal diameter k a pair
    with the next sector has the relative displacement `u - exp(2 pi i k / N) R u_that`, where R turns by one sector;
    the indices of all pairs are the same at each k.

    Parameters
    ----------
    mass, damping, stiffness
        (n, n), kg, N s/m, N/m; symmetric, or Hermitian at nodal diameters above 0. damping: None for none.
    contact_dofs
        (n_contact, 3) int: index in x of the closing, the first and the second tangential relative displacement of each
        pair; -1 where the pair has no such displacement.
    area
        (n_contact,) or one number for all, m2: the weight alpha of Eq. (7).
    load_harmonic, load_static
        (n,), N. The harmonic load is complex and per unit excitation amplitude: load(t) = Re(F exp(i omega t)). The
        static load is 0 if not given. They act at the nodal diameters d and 0.
    response
        Reported responses: indices (n_response,) of x, or a matrix (n_response, n). All of x if not given.
    gap, normal_load
        (n_contact,) or one number. Initial gap, m; constant normal force of pairs without a closing displacement, N,
        compression positive.
    position, surface, response_names
        Position (n_contact, 3), m, and label of each pair; name of each response. They do not change the results.
    n_sectors, nodal_diameter
        Of the cyclic structure and of the wave, 0 to n_sectors - 1; 0 for a structure that is no sector.

    Raises
    ------
    ValueError
        Shapes do not fit, a number is not finite, a nodal diameter is missing, a matrix is not symmetric or Hermitian,
        an area is not positive, or an index is out of range or used twice; nothing presses a pair: no closing
        displacement and no normal load.
    """
    waves = stiffness if isinstance(stiffness, Mapping) else {0: stiffness}
    _check("nodal_diameter", 0 <= nodal_diameter < max(n_sectors, 1), "give 0 to n_sectors - 1")
    for k in needed_nodal_diameters(nodal_diameter, n_sectors, 1):
        _check("stiffness", k in waves, f"give the matrix of nodal diameter {k}")
    linear, excited = {}, min(nodal_diameter, n_sectors - nodal_diameter) if nodal_diameter else 0
    for k in waves:
        linear[k] = _linear(
            waves[k],
            _of_wave("mass", mass, k),
            _of_wave("damping", damping, k),
            _of_wave("response", response, k),
            load_static if k == 0 else None,
            load_harmonic if k == excited else None,
            real=k == 0,
        )
    dofs = _pairs(contact_dofs, min(len(each.stiffness) for each in linear.values()))
    n_contact = len(dofs)
    rows = linear[0].response
    areas = _numbers("area", area, (n_contact,))
    if (areas <= 0.0).any():
        raise ValueError("area: give a positive area, m2, to every contact pair")
    constant = _numbers("normal_load", normal_load, (n_contact,))
    loose = np.flatnonzero((dofs[:, 0] < 0) & (constant <= 0.0))
    if len(loose):
        remedy = f"give pair {loose[0]} more than 0 N, as it has no closing displacement that could press it"
        raise ValueError(f"normal_load: {remedy}")
    nowhere = np.full((n_contact, 3), np.nan)
    contact = ContactInterface(
        dofs=dofs,
        area=areas,
        gap=_numbers("gap", gap, (n_contact,)),
        normal_load=constant,
        position=nowhere if position is None else _numbers("position", position, (n_contact, 3)),
        surface=_names("surface", ("",) * n_contact if surface is None else surface, n_contact),
    )
    default_names = tuple(f"response {index}" for index in range(len(rows)))
    names = _names("response_names", default_names if response_names is None else response_names, len(rows))
    return ReducedModel(linear, contact, names, n_sectors, nodal_diameter)


def _of_wave(name: str, given: OfWaves | None, k: int) -> ArrayLike | None:
    """What is given for a nodal diameter, or for all of them."""
    if not isinstance(given, Mapping):
        return given
    _check(name, k in given, f"give it for nodal diameter {k}, as the stiffness")
    return given[k]


def _linear(
    stiffness: ArrayLike,
    mass: ArrayLike | None,
    damping: ArrayLike | None,
    response: ArrayLike | None,
    load_static: ArrayLike | None,
    load_harmonic: ArrayLike | None,
    *,
    real: bool,
) -> LinearModel:
    """The structure at one nodal diameter. real: whether it is that of nodal diameter 0."""
    k = _matrix("stiffness", stiffness, real=real)
    n = len(k)
    nothing = np.zeros((n, n))
    return LinearModel(
        mass=_matrix("mass", nothing if mass is None else mass, n, real=real),
        damping=_matrix("damping", nothing if damping is None else damping, n, real=real),
        stiffness=k,
        load_static=_numbers("load_static", 0.0 if load_static is None else load_static, (n,)),
        load_harmonic=_load(np.zeros(n) if load_harmonic is None else load_harmonic, n),
        response=np.eye(n) if response is None else _response(response, n, real=real),
    )


def _numbers(name: str, given: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    """A copy as an array of floating-point numbers; a single number is repeated to the shape."""
    found = _array(name, given).astype(np.float64)
    if found.ndim == 0:
        found = np.full(shape, found)
    _check(name, found.shape == shape, f"give shape {shape} instead of {found.shape}")
    _check(name, bool(np.isfinite(found).all()), "give finite numbers")
    return found


def _matrix(name: str, given: ArrayLike, n: int | None = None, *, real: bool) -> Matrix:
    """A symmetric or Hermitian matrix; n: its size, that of the stiffness, None for the stiffness itself."""
    found = _array(name, given, "biufc")
    if real and found.dtype.kind == "c":
        # the matrices of nodal diameter 0 often come as complex ones
        _check(name, bool((found.imag == 0.0).all()), "give real numbers, as a number or an array")
        found = found.real
    if n is None:
        n = len(found) if found.ndim else 0
        _check(name, found.shape == (n, n) and n > 0, f"give a square matrix instead of shape {found.shape}")
    wanted = f"give shape {(n, n)}, as the stiffness has, instead of {found.shape}"
    _check(name, found.shape == (n, n), wanted)
    found = _finite(name, found)
    asymmetry = float(np.abs(found - found.conj().T).max())
    word = "symmetric" if real else "Hermitian"
    _check(name, asymmetry <= _SYMMETRIC * float(np.abs(found).max()), f"give a {word} matrix")
    return found


def _finite(name: str, given: np.ndarray) -> Matrix:
    found: Matrix = given.astype(np.complex128) if given.dtype.kind == "c" else given.astype(np.float64)
    _check(name, bool(np.isfinite(found).all()), "give finite numbers")
    return found


def _array(name: str, given: ArrayLike, kinds: str = "biuf") -> np.ndarray:
    """A copy as an array of real numbers, or of complex ones too where "c" is among the kinds."""
    try:
        found = np.array(given)
    except ValueError:  # rows of unequal length
        raise ValueError(f"{name}: give rows of equal length") from None
    right = found.dtype.kind in kinds
    _check(name, right, f"give {'numbers' if 'c' in kinds else 'real numbers'}, as a number or an array")
    return found


def _pairs(given: ArrayLike, n: int) -> IntArray:
    name = "contact_dofs"
    found = _array(name, given)
    rows = found.ndim == 2 and found.shape[1:] == (3,) and len(found) > 0
    _check(name, rows, "give a row of 3 indices for each pair")
    _check(name, found.dtype.kind in "iu", "give whole numbers")
    _check(name, bool(((found >= -1) & (found < n)).all()), f"give -1 or an index from 0 to {n - 1}")
    used = found[found >= 0]
    _check(name, len(np.unique(used)) == used.size, "give each displacement to one pair only")
    _check(name, bool((found >= 0).any(axis=1).all()), "give every pair a displacement")
    return found.astype(np.int64)


def _load(given: ArrayLike, n: int) -> ComplexArray:
    found = _array("load_harmonic", given, "biufc").astype(np.complex128)
    _check("load_harmonic", found.shape == (n,), f"give shape ({n},) instead of {found.shape}")
    _check("load_harmonic", bool(np.isfinite(found).all()), "give finite numbers")
    return found


def _response(given: ArrayLike, n: int, *, real: bool) -> Matrix:
    name = "response"
    found = _array(name, given, "biuf" if real else "biufc")
    if found.ndim == 2:
        _check(name, found.shape[1] == n, f"give shape {(len(found), n)} instead of {found.shape}")
        return _finite(name, found)
    whole = found.ndim == 1 and found.dtype.kind in "iu"
    _check(name, whole, f"give a list of indices, or a matrix (n_response, {n})")
    _check(name, bool(((found >= 0) & (found < n)).all()), f"give indices from 0 to {n - 1}")
    rows: FloatArray = np.eye(n)[found]
    return rows


def _names(name: str, given: Sequence[str], number: int) -> tuple[str, ...]:
    found = tuple(str(each) for each in given)
    _check(name, len(found) == number and not isinstance(given, str), f"give {number} texts")
    return found


def _check(name: str, right: bool, remedy: str) -> None:
    if not right:
        raise ValueError(f"{name}: {remedy}")
