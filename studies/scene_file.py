"""Scene files: a reduced model from any finite-element code, in HDF5, as `studies/OWN_MODEL.md` describes them.

Numbers may be of any integer or floating type; complex ones are compounds `{r, i}`, as h5py, PyTables and netCDF4 write
them, or `{real, imag}`, as Octave and MATLAB do. Text is UTF-8, of fixed or variable length. Nothing out of the file is
followed. Attributes other than `n_sectors` and `nodal_diameter` are the user's own.

For pictures a file may hold outer faces of the mesh, without influence on the model or its hash: `mesh/x`, `mesh/y`,
`mesh/z` (n_nodes,), m; `mesh/quad` (n_faces, 4), nodes anticlockwise from outside, of a triangle the last one twice;
`mesh/part` (n_faces,), labels. Bodies are told apart by sharing no node. Faces whose corners all stand where contact
pairs of one surface are (`contact/position`) are drawn in contact, as are faces of other bodies that lie on these.
"""

import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from solver.contact.iwan import IwanJoints
from solver.contact.springs import CubicSprings
from solver.model import ContactInterface, LinearModel, PairLaw, ReducedModel
from studies.hdf5 import Datasets, as_whole, find_datasets, open_hdf5, read_attribute, read_dataset, read_text_attribute
from studies.model_check import check_model, is_grouped
from studies.scene import SurfaceMesh
from studies.scene_error import SceneError

CONTACT = {
    "dofs": "whole",
    **dict.fromkeys(("area", "gap", "normal_load", "friction_coefficient", "position"), "real"),
    "edge": "flags",
    "surface": "text",
}
"""Fields of the contact pairs, and what their numbers are."""
LINEAR = ("mass", "damping", "stiffness", "blade", "load/static", "load/harmonic", "response/dofs", "response/names")
LAWS: dict[str, tuple[Callable[..., PairLaw], tuple[str, ...]]] = {
    "springs": (CubicSprings, ("linear", "cubic")),
    "iwan": (IwanJoints, ("stiffness", "limit", "normal_stiffness")),
}
"""Laws of pairs that do not rub: each a group of `contact` with its numbers for all pairs, 0 for those with others."""
MESH = ("x", "y", "z", "quad", "part")
ATTRIBUTES = ("n_sectors", "nodal_diameter")
PAIRS_ARE_ROWS = ("rows", "pairs")
"""Name and value of an attribute of the dataset `contact/dofs` that is not transposed."""
DESCRIPTION = (
    *("model_files", "model_units", "model_reduced_by"),
    *("contact_directions", "contact_origin", "contact_mirrored"),
)
"""Attributes of a file, texts. Of a model that was reduced here from finite elements: its files. For pictures: what the
directions of the tangents are called, as "axial, up the flank"; where they begin; and the axes along which the contact
is symmetric about the origin, where the pairs are those of one side."""


def write_scene(
    model: ReducedModel, path: str | Path, mesh: SurfaceMesh | None = None, description: Mapping[str, str] | None = None
) -> None:
    """Write a model as a scene file, complete or not at all; an existing file is replaced.

    description: attributes of the file, see `DESCRIPTION`. Reading it gives the same model bit by bit.
    Raises SceneError where the model is impossible, OSError where the file cannot be written.
    """
    check_model(model)
    path = Path(path)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with h5py.File(unfinished, "w") as file:
            file.attrs.update({**scene_attributes(model), **(description or {})})
            for key, values in scene_datasets(model, mesh):
                kind = h5py.string_dtype("utf-8") if values.dtype.kind == "U" else values.dtype
                file.create_dataset(key, data=values.astype(object) if values.dtype.kind == "U" else values, dtype=kind)
            file["contact/dofs"].attrs.update([PAIRS_ARE_ROWS])
        os.replace(unfinished, path)
    finally:
        unfinished.unlink(missing_ok=True)


def read_scene(path: str | Path, n_harmonics: int = 1, group: str = "") -> ReducedModel:
    """Reduced model of a scene file (HDF5), see `studies.scene_file`.

    n_harmonics: the file must hold the nodal diameters that the harmonics 0..n_harmonics of its travelling wave see.
    group: where the scene stands in a file that holds more.

    Raises SceneError about the dataset that is wrong, about "model" where the file is no HDF5; OSError where there is
    no such file or it cannot be opened.
    """
    with _open_scene(Path(path), group) as (root, datasets, prefixes):
        n_sectors, nodal_diameter = (_read_count(root, name, required=prefixes != {0: ""}) for name in ATTRIBUTES)
        linear = {k: _read_linear(datasets, prefix, real=k == 0) for k, prefix in prefixes.items()}
        names = _read_names(datasets, prefixes.values())
        model = ReducedModel(linear, _read_contact(datasets), names, n_sectors, nodal_diameter)
        marked = read_text_attribute(datasets["contact/dofs"], PAIRS_ARE_ROWS[0]) == PAIRS_ARE_ROWS[1]
        shapes = [each.shape for key, each in datasets.items() if key.endswith(("response/dofs", "mesh/quad"))]
    check_model(model, n_harmonics)
    # results are written here
    if not (group or marked or any(len(shape) == 2 and shape[0] != shape[1] for shape in shapes)):
        _check_order(model.contact)
    return model


def read_mesh(path: str | Path, group: str = "") -> SurfaceMesh | None:
    """The mesh of a scene file, None where it has none. Raises what `read_scene` raises."""
    with _open_scene(Path(path), group) as (_, datasets, _):
        if not any(key.startswith("mesh/") for key in datasets):
            return None
        axes = [read_dataset(datasets, f"mesh/{axis}", "real") for axis in "xyz"]
        for axis, values in zip("xyz", axes, strict=True):
            if values.shape != (axes[0].size,) or not np.isfinite(values).all():
                raise SceneError(f"mesh/{axis}", f"shape {values.shape}", "give one finite number for each node")
        quads = read_dataset(datasets, "mesh/quad", "whole")
        if quads.ndim != 2 or quads.shape[1] != 4:
            raise SceneError("mesh/quad", f"shape {quads.shape}", "give one row of 4 nodes for each face")
        _check_indices("mesh/quad", quads, axes[0].size)
        parts = read_dataset(datasets, "mesh/part", "text")
        if len(parts) != len(quads):
            raise SceneError("mesh/part", f"{len(parts)} labels", f"give one label for each of {len(quads)} faces")
        return SurfaceMesh(np.stack(axes, axis=1), quads, parts)


def read_description(path: str | Path) -> dict[str, str]:
    """Attributes of a scene or result file, those of `DESCRIPTION` that it has. Raises as `read_scene`."""
    with open_hdf5(Path(path)) as file:
        return {name: text for name in DESCRIPTION if (text := read_text_attribute(file, name))}


@contextmanager
def _open_scene(path: Path, group: str) -> Iterator[tuple[h5py.Group, Datasets, dict[int, str]]]:
    """Group and datasets of a scene, and how their names begin for each nodal diameter, "" without groups `nd`."""
    with open_hdf5(path) as file:
        root = file.get(group) if group else file
        if not isinstance(root, h5py.Group):
            raise SceneError(group, "missing", f"give a file with a group {group}")
        datasets = find_datasets(root)
        diameters = {int(match[1]) for key in datasets if (match := re.match(r"nd/(0|[1-9][0-9]*)/", key))}
        prefixes = {k: f"nd/{k}/" for k in sorted(diameters)} or {0: ""}
        known = [f"contact/{name}" for name in CONTACT] + [f"mesh/{name}" for name in MESH]
        known += [prefix + name for prefix in prefixes.values() for name in LINEAR]
        known += [f"contact/{law}/{name}" for law, (_, names) in LAWS.items() for name in names]
        for key in datasets:
            if key not in (*known, "response/names"):
                remedy = f"remove it, known are {', '.join(known[: len(CONTACT) + len(MESH)] + list(LINEAR))}"
                where = "" if prefixes == {0: ""} else ", the latter in nd/<nodal diameter>/"
                raise SceneError(key, "unknown dataset", remedy + where)
        yield root, datasets, prefixes


def _check_indices(key: str, indices: NDArray[np.int64], n: int) -> None:
    if (outside := indices[(indices < 0) | (indices >= n)]).size:
        raise SceneError(key, str(outside[0]), f"give indices from 0 to {n - 1}")


def _read_count(root: h5py.Group, name: str, *, required: bool) -> int:
    value = read_attribute(root, name)
    if value is None and required:
        raise SceneError(name, "missing", f"give the attribute {name} to a file with groups nd/<k>")
    number: Any = 0 if value is None else value.item()
    if not isinstance(number, int | float) or not abs(number) < 2**31 or number != int(number):
        raise SceneError(name, str(number), "give a whole number as the attribute")
    return int(number)


def _read_names(datasets: Datasets, prefixes: Iterable[str]) -> tuple[str, ...]:
    """Names of the responses, the same in all groups, or beside them."""
    shared, found = "response/names", tuple[str, ...]()
    for prefix in prefixes:
        key = f"{prefix}{shared}"
        names = read_dataset(datasets, key if key in datasets or shared not in datasets else shared, "text")
        if names != (found or names):
            raise SceneError(key, ", ".join(names), f"give the same names as elsewhere: {found}")
        found = names
    return found


def _read_linear(datasets: Datasets, prefix: str, *, real: bool) -> LinearModel:
    def matrix(name: str) -> Any:
        """Numbers as they are, but without the imaginary part where it is zero and cannot be anything else."""
        values = read_dataset(datasets, prefix + name, "any")
        return values.real.copy() if real and not values.imag.any() else values

    stiffness, mass, response = matrix("stiffness"), matrix("mass"), matrix("response/dofs")
    key, n = f"{prefix}response/dofs", len(stiffness)
    if response.ndim == 1 and stiffness.shape == (n, n):  # of another shape that is said first
        indices = as_whole(key, response)
        _check_indices(key, indices, n)
        response = np.eye(n)[indices]
    key = f"{prefix}damping"
    damping = matrix("damping") if key in datasets else np.zeros(stiffness.shape)
    if damping.shape == (2,):  # coefficients of mass, 1/s, and stiffness, s
        if np.iscomplexobj(damping) or not np.isfinite(damping).all():
            remedy = "give two finite numbers: of mass, 1/s, and stiffness, s"
            raise SceneError(key, f"{damping[0]}, {damping[1]}", remedy)
        # a wrong shape is said of the mass
        fits = mass.shape == stiffness.shape
        damping = damping[0] * mass + damping[1] * stiffness if fits else np.zeros(stiffness.shape)
    return LinearModel(
        mass=mass,
        damping=damping,
        stiffness=stiffness,
        load_static=read_dataset(datasets, f"{prefix}load/static", "real"),
        load_harmonic=read_dataset(datasets, f"{prefix}load/harmonic", "any").astype(np.complex128),
        response=response,
        blade=matrix("blade") if f"{prefix}blade" in datasets else None,
    )


def _read_contact(datasets: Datasets) -> ContactInterface:
    keys = [name for name in CONTACT if f"contact/{name}" in datasets or name in ("dofs", "area")]
    found = {name: read_dataset(datasets, f"contact/{name}", CONTACT[name]) for name in keys}
    n_contact = len(found["dofs"])
    absent = {"gap": np.zeros(n_contact), "normal_load": np.zeros(n_contact), "surface": ("",) * n_contact}
    laws = tuple(_read_laws(datasets, n_contact))
    try:
        return ContactInterface(**{**absent, "position": np.full((n_contact, 3), np.nan), **found}, laws=laws)
    except ValueError as error:
        raise SceneError("contact", "two laws of one pair", str(error)) from None


def _read_laws(datasets: Datasets, n_contact: int) -> Iterator[PairLaw]:
    for law, (make, names) in LAWS.items():
        keys = [f"contact/{law}/{name}" for name in names]
        if not any(key in datasets for key in keys):
            continue
        values = [read_dataset(datasets, key, "real") for key in keys]
        for key, each in zip(keys, values, strict=True):
            if len(each) != n_contact:
                raise SceneError(key, f"shape {each.shape}", f"give a row for each of {n_contact} pairs")
        pairs = np.flatnonzero(np.any([each.reshape(n_contact, -1).any(axis=1) for each in values], axis=0))
        try:
            yield make(tuple(pairs.tolist()), *(each[pairs] for each in values))
        except ValueError as error:
            name, remedy = str(error).split(": ", 1)
            raise SceneError(
                f"contact/{law}/{name}", "impossible for a pair with other numbers than 0", remedy
            ) from None


def _check_order(contact: ContactInterface) -> None:
    """Raise SceneError where `contact/dofs` may as well be transposed: that of three pairs is square.

    Of a file without the attribute PAIRS_ARE_ROWS, or an array that is not square and has the right shape.
    """
    dofs, turned = contact.dofs, contact.dofs.T
    if dofs.shape != (3, 3) or np.array_equal(dofs, turned):
        return
    if not (turned < 0).all(axis=1).any() and (contact.normal_load[turned[:, 0] < 0] > 0).all():
        name, value = PAIRS_ARE_ROWS
        found = "3 pairs, and nothing shows whether a row is a pair or, as MATLAB and Fortran write it, a direction"
        remedy = f'write one row for each pair, and give the dataset the attribute {name} = "{value}"'
        raise SceneError("contact/dofs", found, remedy)


def scene_attributes(model: ReducedModel) -> dict[str, int]:
    """Attributes of the scene; none where the structure is no sector."""
    return {name: getattr(model, name) for name in ATTRIBUTES} if model.n_sectors else {}


def _law_datasets(contact: ContactInterface) -> dict[str, NDArray[np.float64]]:
    found = dict[str, NDArray[np.float64]]()
    for law in contact.laws:
        name = next((name for name, (make, _) in LAWS.items() if type(law) is make), None)
        if name is None:
            raise SceneError("contact", type(law).__name__, f"a file holds the laws {', '.join(LAWS)} alone")
        for field in LAWS[name][1]:
            given = getattr(law, field)
            values = found.setdefault(f"contact/{name}/{field}", np.zeros((contact.n_contact, *given.shape[1:])))
            values[list(law.pairs)] = given
    return found


def scene_datasets(model: ReducedModel, mesh: SurfaceMesh | None) -> Iterator[tuple[str, NDArray[np.generic]]]:
    """Name with its groups and values of each dataset; texts as arrays of numpy's type U."""
    contact = model.contact
    for name in list(CONTACT)[:-1]:
        values = getattr(contact, name)
        # without friction coefficients or edges of its own a scene has no such dataset
        if values is not None:
            # HDF5 has no boolean numbers
            yield f"contact/{name}", values.astype(np.int8) if values.dtype.kind == "b" else values
    yield "contact/surface", np.array(contact.surface, dtype=np.str_)
    yield from _law_datasets(contact).items()
    for k, linear in model.linear.items():
        prefix = f"nd/{k}/" if is_grouped(model) else ""
        for name in LINEAR[:-1]:  # "load/static" is `load_static`, "response/dofs" is `response`
            values = getattr(linear, name.replace("/", "_").removesuffix("_dofs"))
            # not every sector knows the modes of its blade
            if values is not None:
                yield prefix + name, values
        yield f"{prefix}response/names", np.array(model.response_names, dtype=np.str_)
    if mesh is not None:
        for column, axis in enumerate("xyz"):
            yield f"mesh/{axis}", mesh.nodes[:, column]
        yield "mesh/quad", mesh.quads
        yield "mesh/part", np.array(mesh.parts, dtype=np.str_)
