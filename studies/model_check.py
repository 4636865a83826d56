"""Whether the reduced model of a scene file describes a possible structure with contact pairs on it.

What is legal and may surprise: a massless displacement that has stiffness, a rigid body motion that has mass and that a
contact can hold, a negative gap (interference), a stiffness that is not positive definite (spin softening).
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cholesky, get_lapack_funcs

from solver.model import ContactInterface, LinearModel, Matrix, ReducedModel, needed_nodal_diameters
from solver.model_from_matrices import find_asymmetry
from studies.scene_error import SceneError

TRANSPOSED = ": MATLAB and Fortran write columns first, so transpose every matrix of the file"
"""End of the remedy where a matrix has the right shape once it is transposed."""

_NEGATIVE_MASS = 1e-9  # of the largest entry: a negative eigenvalue of that size is round-off
_REAL = 1e-9  # imaginary part at nodal diameter 0, relative to the largest entry, that is round-off


def check_model(model: ReducedModel, n_harmonics: int = 1) -> None:
    """Raise SceneError, with the dataset of the scene file as its key, for the first thing in the model that cannot be.

    n_harmonics: harmonics 0..n_harmonics must find their nodal diameter in the model.
    """
    if model.n_sectors < 0:
        remedy = "give the number of sectors, or 0 for a structure that is no sector"
        raise SceneError("n_sectors", str(model.n_sectors), remedy)
    # above half the number of sectors a wave travels backwards
    if not 0 <= model.nodal_diameter <= max(model.n_sectors - 1, 0):
        raise SceneError("nodal_diameter", str(model.nodal_diameter), f"give 0 to {max(model.n_sectors - 1, 0)}")
    names = model.response_names
    if not names or "" in names or len(set(names)) < len(names):
        found = ", ".join(f'"{name}"' for name in names) or "no name"
        raise SceneError("response/names", found, "give at least one response, each with a name of its own")
    for harmonic in range(n_harmonics + 1):
        for k in set(needed_nodal_diameters(model.nodal_diameter, model.n_sectors, harmonic)) - set(model.linear):
            wave = f"harmonic {harmonic} of a wave of nodal diameter {model.nodal_diameter}"
            few = f", or use fewer than {harmonic} harmonics" if harmonic > 1 else ""
            raise SceneError(f"nd/{k}", "missing", f"give this group, which {wave} needs{few}")
    for k, linear in model.linear.items():
        if not 0 <= k <= model.n_sectors // 2:
            found = f"there are {model.n_sectors} sectors"
            raise SceneError(f"nd/{k}", found, f"give nodal diameters of 0 to {model.n_sectors // 2}")
        _check_linear(linear, f"nd/{k}/" if is_grouped(model) else "", len(model.response_names))
    _check_contact(model.contact, min(len(linear.stiffness) for linear in model.linear.values()))
    _check_static(model.linear[0], model.contact, "nd/0/" if is_grouped(model) else "")


def is_grouped(model: ReducedModel) -> bool:
    """Whether a scene file holds the model in groups `nd/<k>/`: a travelling wave, or several nodal diameters."""
    return model.nodal_diameter > 0 or len(model.linear) > 1


def _check_contact(contact: ContactInterface, n: int) -> None:
    dofs = contact.dofs
    if dofs.ndim != 2 or dofs.shape[1] != 3 or len(dofs) == 0:
        remedy = "give one row of 3 indices for each pair, at least one row"
        turned = TRANSPOSED if dofs.ndim == 2 and dofs.shape[0] == 3 else ""
        raise SceneError("contact/dofs", f"shape {dofs.shape}", remedy + turned)
    n_contact = len(dofs)
    for name in ("area", "gap", "normal_load", "position", "friction_coefficient", "edge"):
        if (values := getattr(contact, name)) is not None:
            _check_shape(f"contact/{name}", values, (n_contact, 3) if name == "position" else (n_contact,))
            infinite = np.isinf(values) if name == "position" else ~np.isfinite(values)
            _refuse(f"contact/{name}", values, infinite, "give finite numbers")
    if len(contact.surface) != n_contact:
        found = f"{len(contact.surface)} labels"
        raise SceneError("contact/surface", found, f"give one label for each of {n_contact} pairs")
    _refuse("contact/dofs", dofs, (dofs < -1) | (dofs >= n), f"give -1 or an index from 0 to {n - 1}")
    used, counts = np.unique(dofs[dofs >= 0], return_counts=True)
    if (counts > 1).any():
        found = f"index {used[counts > 1][0]} is used twice"
        raise SceneError("contact/dofs", found, "give every direction a displacement of its own")
    if len(without := np.flatnonzero((dofs < 0).all(axis=1))):
        raise SceneError("contact/dofs", f"pair {without[0]} has no direction", "give it at least one, or leave it out")
    _refuse("contact/area", contact.area, contact.area <= 0, "give a positive area in m2")
    if contact.friction_coefficient is not None:
        friction = contact.friction_coefficient
        _refuse("contact/friction_coefficient", friction, friction < 0, "give 0 or more")
    loose = (dofs[:, 0] < 0) & (contact.normal_load <= 0) & contact.rubs
    remedy = "give a positive normal force in N to a pair without closing displacement"
    _refuse("contact/normal_load", contact.normal_load, loose, remedy)


def _check_linear(linear: LinearModel, prefix: str, n_response: int) -> None:
    n = len(linear.stiffness) if linear.stiffness.ndim == 2 else 0
    if n == 0 or linear.stiffness.shape != (n, n):
        raise SceneError(f"{prefix}stiffness", f"shape {linear.stiffness.shape}", "give a square matrix")
    parts = {
        **{name: (getattr(linear, name), (n, n)) for name in ("stiffness", "mass", "damping")},
        "load/static": (linear.load_static, (n,)),
        "load/harmonic": (linear.load_harmonic, (n,)),
        "response/dofs": (linear.response, (n_response, n)),
    }
    if linear.blade is not None:
        parts["blade"] = linear.blade, (*linear.blade.shape[:1], n)
    # all shapes before any number: what does not fit together takes no time
    for name, (values, shape) in parts.items():
        _check_shape(prefix + name, values, shape)
    for name, (values, _) in parts.items():
        _refuse(prefix + name, values, ~np.isfinite(values), "give finite numbers")
    for name in ("stiffness", "mass", "damping"):
        if places := find_asymmetry(matrix := parts[name][0]):
            word, (row, column) = "Hermitian" if np.iscomplexobj(matrix) else "symmetric", places
            entries = f"{matrix[row, column]} at {row}, {column} but {matrix[column, row]} at {column}, {row}"
            raise SceneError(prefix + name, f"not {word}: {entries}", f"give a {word} matrix")
    if np.iscomplexobj(linear.load_static):
        raise SceneError(f"{prefix}load/static", "complex", "give real forces")

    try:
        cholesky(linear.mass + _NEGATIVE_MASS * _largest(linear.mass) * np.eye(n))
    except LinAlgError:
        if _largest(linear.mass) > 0:
            raise SceneError(f"{prefix}mass", "a negative eigenvalue", "give a positive semidefinite matrix") from None
    # For a positive semidefinite mass, K + i M is singular only where a motion has neither stiffness nor mass.
    stiffness, mass = (matrix / (_largest(matrix) or 1.0) for matrix in (linear.stiffness, linear.mass))
    if _is_singular(stiffness + 1j * mass):
        raise SceneError(f"{prefix}stiffness", "singular together with mass", "give every motion stiffness or mass")


def _check_static(linear: LinearModel, contact: ContactInterface, prefix: str) -> None:
    """The model of the static harmonic: real, and no motion without stiffness that no contact can hold."""
    for name in ("stiffness", "mass", "damping", "response"):
        matrix = getattr(linear, name)
        if np.abs(matrix.imag).max() > _REAL * _largest(matrix):
            dataset = "response/dofs" if name == "response" else name
            raise SceneError(f"{prefix}{dataset}", "complex", "give a real matrix: nodal diameter 0 has no phase")
    away = np.setdiff1d(np.arange(len(linear.stiffness)), contact.dofs)
    if _is_singular(linear.stiffness[np.ix_(away, away)]):
        remedy = "support every motion by stiffness or by a contact pair"
        raise SceneError(f"{prefix}stiffness", "singular among the displacements without contact", remedy)


def _check_shape(key: str, values: NDArray[Any], shape: tuple[int, ...]) -> None:
    if values.shape != shape:
        turned = TRANSPOSED if len(shape) == 2 and values.shape == shape[::-1] else ""
        raise SceneError(key, f"shape {values.shape}", f"give shape {shape}{turned}")


def _refuse(key: str, values: NDArray[Any], wrong: NDArray[np.bool_], remedy: str) -> None:
    """Raises SceneError about the first of the values that are wrong."""
    if len(places := np.argwhere(wrong)):
        at = ", ".join(str(int(index)) for index in places[0])
        raise SceneError(key, f"{values[tuple(places[0])]} at index {at}", remedy)


def _is_singular(matrix: NDArray[Any]) -> bool:
    """Whether a Hermitian (or complex symmetric) matrix is singular to round-off."""
    n = len(matrix)
    if n == 0:
        return False
    diagonal, rows = np.abs(np.diag(matrix)), np.abs(matrix).max(axis=1)
    # Displacements and modal coordinates have different units: make the diagonal 1 before judging.
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, np.maximum(rows, np.finfo(np.float64).tiny)))
    balanced = matrix * np.outer(scale, scale)
    if (rows == 0).any() or not np.isfinite(balanced).all():
        return True
    factorise, estimate = get_lapack_funcs(("getrf", "gecon"), (balanced,))
    factors, _, info = factorise(balanced)
    reciprocal, more = estimate(factors, np.abs(balanced).sum(axis=0).max()) if info == 0 else (0.0, 0)
    return bool(more != 0 or reciprocal <= max(n, 10) * np.finfo(np.float64).eps)


def _largest(matrix: Matrix) -> float:
    return float(np.abs(matrix).max())
