"""Scene files: a reduced model from any finite-element code, in HDF5.

Numbers may be of any integer or floating type; complex ones are compounds `{r, i}`, as h5py, PyTables and netCDF4 write
them, or `{real, imag}`, as Octave and MATLAB do. Text is UTF-8, of fixed or variable length. Files are read without
following anything out of them: external and soft links, external storage and virtual datasets are refused. Attributes
other than `n_sectors` and `nodal_diameter` are the user's own. `damping` may be two numbers, 1/s and s: coefficients
of mass and stiffness. `contact/edge` is 1 for pairs beyond which the bodies go on without pairs, 0 for the others.

Programs that store columns first (MATLAB, Fortran) write matrices transposed, which their shapes show. `contact/dofs`
of three pairs is square: where no other array of the file shows the order, it needs the attribute rows = "pairs".

For pictures a file may hold outer faces of the mesh, without influence on the model or its hash: `mesh/x`, `mesh/y`,
`mesh/z` (n_nodes,), m; `mesh/quad` (n_faces, 4), nodes anticlockwise from outside, of a triangle the last one twice;
`mesh/part` (n_faces,), labels. Bodies are told apart by sharing no node. Faces whose corners all stand where contact
pairs of one surface are (`contact/position`) are drawn in contact, as are faces of other bodies that lie on these.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from solver.model import (
    BoolArray,
    ComplexArray,
    ContactInterface,
    FloatArray,
    IntArray,
    LinearModel,
    Matrix,
    ReducedModel,
)
from studies.hdf5 import find_datasets, is_number, open_hdf5, read_attribute, read_text_attribute, read_texts
from studies.model_check import PAIRS_ARE_ROWS, check_model, check_order, check_sector
from studies.scene_answers import SurfaceMesh
from studies.scene_error import SceneError
from studies.scene_layout import ATTRIBUTES, CONTACT, LINEAR, MESH, ORIGIN, scene_attributes, scene_datasets


def write_scene(
    model: ReducedModel, path: str | Path, mesh: SurfaceMesh | None = None, origin: Mapping[str, str] | None = None
) -> None:
    """Write a model as a scene file, complete or not at all; an existing file is replaced.

    origin: texts on where the model comes from, attributes of the file.

    Reading it gives the same model bit by bit. Raises SceneError where the model is impossible, OSError where the file
    cannot be written.
    """
    check_model(model)
    path = Path(path)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with h5py.File(unfinished, "w") as file:
            file.attrs.update({**scene_attributes(model), **(origin or {})})
            for key, values in scene_datasets(model, mesh):
                kind = h5py.string_dtype("utf-8") if values.dtype.kind == "U" else values.dtype
                file.create_dataset(key, data=values.astype(object) if values.dtype.kind == "U" else values, dtype=kind)
            file["contact/dofs"].attrs.update([PAIRS_ARE_ROWS])
        os.replace(unfinished, path)
    finally:
        unfinished.unlink(missing_ok=True)


def read_scene(path: str | Path, n_harmonics: int = 1, group: str = "") -> ReducedModel:
    """Read and check a scene file.

    n_harmonics: harmonics 0..n_harmonics must find their nodal diameter in the file. group: where the scene stands in a
    file that holds more than one.

    Raises SceneError for wrong content, with the dataset as its key, and for a file that is not HDF5, with the key
    "model"; OSError where the file is missing or cannot be opened.
    """
    with _open_scene(Path(path), group) as (root, datasets):
        model = _read_model(root, datasets)
        # results are written here
        shows_order = bool(group) or _shows_order(datasets)
    check_model(model, n_harmonics, grouped=_is_grouped(datasets))
    if not shows_order:
        check_order(model.contact)
    return model


def read_mesh(path: str | Path, group: str = "") -> SurfaceMesh | None:
    """The mesh of a scene file, None where it has none. Raises what `read_scene` raises."""
    with _open_scene(Path(path), group) as (_, datasets):
        return _read_mesh(datasets) if _has_mesh(datasets) else None


def read_origin(path: str | Path) -> dict[str, str]:
    """Attributes of a scene or result file that say which model its scene was reduced from; none where it does not say.

    Raises what `read_scene` raises.
    """
    with open_hdf5(Path(path)) as file:
        return {name: text for name in ORIGIN if (text := read_text_attribute(file, name))}


def has_mesh(path: str | Path, group: str = "") -> bool:
    """Whether a scene file has a mesh. Raises what `read_scene` raises."""
    with _open_scene(Path(path), group) as (_, datasets):
        return _has_mesh(datasets)


@contextmanager
def _open_scene(path: Path, group: str) -> Iterator[tuple[h5py.Group, dict[str, h5py.Dataset]]]:
    """Group and datasets of a scene, found and looked at, but not read."""
    with open_hdf5(path) as file:
        root = file.get(group) if group else file
        if not isinstance(root, h5py.Group):
            raise SceneError(group, "missing", f"give a file with a group {group}")
        datasets = find_datasets(root)
        _refuse_unknown(datasets, _is_grouped(datasets))
        yield root, datasets


def _is_grouped(datasets: Iterable[str]) -> bool:
    return any(key.startswith("nd/") for key in datasets)


def _has_mesh(datasets: Iterable[str]) -> bool:
    return any(key.startswith("mesh/") for key in datasets)


def _read_model(root: h5py.Group, datasets: Mapping[str, h5py.Dataset]) -> ReducedModel:
    grouped = _is_grouped(datasets)
    n_sectors, nodal_diameter = (_read_count(root, name, required=grouped) for name in ATTRIBUTES)
    check_sector(n_sectors, nodal_diameter)

    prefixes = {0: ""}
    if grouped:
        numbers = sorted({int(key.split("/")[1]) for key in datasets if key.startswith("nd/")})
        prefixes = {k: f"nd/{k}/" for k in numbers}
    linear = {k: _read_linear(datasets, prefix, real=k == 0) for k, prefix in prefixes.items()}
    names = {prefix: _read_names(datasets, prefix) for prefix in prefixes.values()}
    first = next(iter(names.values()))
    for prefix, others in names.items():
        if others != first:
            raise SceneError(f"{prefix}response/names", ", ".join(others), f"give the same names as elsewhere: {first}")
    return ReducedModel(
        linear=linear,
        contact=_read_contact(datasets),
        response_names=first,
        n_sectors=n_sectors,
        nodal_diameter=nodal_diameter,
    )


def _read_mesh(datasets: Mapping[str, h5py.Dataset]) -> SurfaceMesh:
    axes = [_read_real(datasets, f"mesh/{axis}") for axis in "xyz"]
    n_nodes = axes[0].size
    for axis, values in zip("xyz", axes, strict=True):
        if values.shape != (n_nodes,):
            raise SceneError(f"mesh/{axis}", f"shape {values.shape}", f"give shape ({n_nodes},), as mesh/x has")
        if not np.isfinite(values).all():
            raise SceneError(f"mesh/{axis}", "not finite", "give finite numbers")
    quads = _whole("mesh/quad", _read_numbers(datasets, "mesh/quad"))
    if quads.ndim != 2 or quads.shape[1] != 4:
        raise SceneError("mesh/quad", f"shape {quads.shape}", "give one row of 4 nodes for each face")
    outside = quads[(quads < 0) | (quads >= n_nodes)]
    if len(outside):
        raise SceneError("mesh/quad", str(outside[0]), f"give nodes from 0 to {n_nodes - 1}")
    parts = _read_text(datasets, "mesh/part")
    if len(parts) != len(quads):
        raise SceneError("mesh/part", f"{len(parts)} labels", f"give one label for each of {len(quads)} faces")
    return SurfaceMesh(np.stack(axes, axis=1), quads, parts)


def _refuse_unknown(datasets: Iterable[str], grouped: bool) -> None:
    contact = {f"contact/{name}" for name in CONTACT}
    mesh = {f"mesh/{name}" for name in MESH}
    for key in datasets:
        if key in contact or key in mesh or (grouped and key == "response/names"):
            continue
        dataset = key
        if grouped:
            group, number, *below = [*key.split("/"), ""]
            if group != "nd" or not number.isdecimal() or str(int(number)) != number:
                raise SceneError(key, "unknown dataset", "remove it, or move it into nd/<nodal diameter>/")
            dataset = "/".join(below[:-1])
        if dataset not in LINEAR:
            raise SceneError(
                key, "unknown dataset", f"remove it, known are {', '.join([*sorted(contact | mesh), *LINEAR])}"
            )


def _read_count(root: h5py.Group, name: str, *, required: bool) -> int:
    value = read_attribute(root, name)
    if value is None:
        if required:
            raise SceneError(name, "missing", f"give the attribute {name} to a file with groups nd/<k>")
        return 0
    number = value.item()
    if value.dtype.kind not in "iuf" or not abs(number) < 2**31 or number != np.floor(number):
        raise SceneError(name, str(number), "give a whole number as the attribute")
    return int(number)


def _read_linear(datasets: Mapping[str, h5py.Dataset], prefix: str, *, real: bool) -> LinearModel:
    stiffness = _read_matrix(datasets, f"{prefix}stiffness", real)
    response = _read_matrix(datasets, f"{prefix}response/dofs", real)
    if response.ndim == 1:
        response = _selection(f"{prefix}response/dofs", response, len(stiffness))
    harmonic: ComplexArray = _read_numbers(datasets, f"{prefix}load/harmonic").astype(np.complex128)
    mass = _read_matrix(datasets, f"{prefix}mass", real)
    return LinearModel(
        mass=mass,
        damping=_read_damping(datasets, f"{prefix}damping", mass, stiffness, real=real),
        stiffness=stiffness,
        load_static=_read_real(datasets, f"{prefix}load/static"),
        load_harmonic=harmonic,
        response=response,
    )


def _read_damping(
    datasets: Mapping[str, h5py.Dataset], key: str, mass: Matrix, stiffness: Matrix, *, real: bool
) -> Matrix:
    """The matrix; or `a M + b K` from two coefficients a, 1/s, and b, s; or zeros where there is none."""
    if key not in datasets:
        return np.zeros(stiffness.shape)
    damping = _read_matrix(datasets, key, real)
    if damping.shape != (2,):
        return damping
    if np.iscomplexobj(damping) or not np.isfinite(damping).all():
        raise SceneError(key, f"{damping[0]}, {damping[1]}", "give two finite numbers: of mass, 1/s, and stiffness, s")
    if mass.shape != stiffness.shape:
        # what fits not is said of the mass
        return np.zeros(stiffness.shape)
    combined: Matrix = damping[0] * mass + damping[1] * stiffness
    return combined


def _selection(key: str, indices: Matrix, n: int) -> FloatArray:
    """Rows (n_response, n) that pick displacements by their indices."""
    whole = _whole(key, indices)
    outside = whole[(whole < 0) | (whole >= n)]
    if len(outside):
        raise SceneError(key, str(outside[0]), f"give indices from 0 to {n - 1}, or a matrix")
    return np.eye(n)[whole]


def _read_names(datasets: Mapping[str, h5py.Dataset], prefix: str) -> tuple[str, ...]:
    key = f"{prefix}response/names"
    return _read_text(datasets, key if key in datasets or not prefix else "response/names")


def _read_contact(datasets: Mapping[str, h5py.Dataset]) -> ContactInterface:
    dofs = _whole("contact/dofs", _read_numbers(datasets, "contact/dofs"))
    n_contact = len(dofs)
    absent = {
        "gap": np.zeros(n_contact),
        "normal_load": np.zeros(n_contact),
        "position": np.full((n_contact, 3), np.nan),
    }
    gap, normal_load, position = (
        _read_real(datasets, f"contact/{name}") if f"contact/{name}" in datasets else values
        for name, values in absent.items()
    )
    labelled = "contact/surface" in datasets
    friction = "contact/friction_coefficient"
    return ContactInterface(
        dofs=dofs,
        area=_read_real(datasets, "contact/area"),
        gap=gap,
        normal_load=normal_load,
        position=position,
        surface=_read_text(datasets, "contact/surface") if labelled else ("",) * n_contact,
        friction_coefficient=_read_real(datasets, friction) if friction in datasets else None,
        edge=_flags("contact/edge", _read_numbers(datasets, "contact/edge")) if "contact/edge" in datasets else None,
    )


def _shows_order(datasets: Mapping[str, h5py.Dataset]) -> bool:
    """Whether the file shows that its arrays are not transposed: by the attribute, or by an array that is not square.

    Such an array would be refused for its shape.
    """
    name, value = PAIRS_ARE_ROWS
    if read_text_attribute(datasets["contact/dofs"], name) == value:
        return True
    shapes = [dataset.shape for key, dataset in datasets.items() if key.endswith(("response/dofs", "mesh/quad"))]
    return any(len(shape) == 2 and shape[0] != shape[1] for shape in shapes)


def _flags(key: str, values: NDArray[Any]) -> BoolArray:
    wrong = values[(values != 0) & (values != 1)]
    if wrong.size:
        raise SceneError(key, str(wrong.flat[0]), "give 0 or 1")
    return np.asarray(values == 1)


def _whole(key: str, values: NDArray[Any]) -> IntArray:
    # MATLAB writes whole numbers as floating ones.
    with np.errstate(invalid="ignore"):
        whole: IntArray = values.real.astype(np.int64)
    wrong = values[whole != values]
    if wrong.size:
        raise SceneError(key, str(wrong.flat[0]), "give whole numbers")
    return whole


def _read_matrix(datasets: Mapping[str, h5py.Dataset], key: str, real: bool) -> Matrix:
    """Numbers as they are, but without the imaginary part where it is zero and cannot be anything else."""
    values: Matrix = _read_numbers(datasets, key)
    return values.real.copy() if real and not values.imag.any() else values


def _read_real(datasets: Mapping[str, h5py.Dataset], key: str) -> FloatArray:
    values: FloatArray = _read_numbers(datasets, key)
    if np.iscomplexobj(values):
        raise SceneError(key, "complex", "give real numbers")
    return values


def _read_numbers(datasets: Mapping[str, h5py.Dataset], key: str) -> Any:
    """Values as float64 or complex128."""
    dataset = _dataset(datasets, key)
    if not is_number(dataset.dtype):
        raise SceneError(key, f"type {dataset.dtype}", "give numbers")
    names = dataset.dtype.names
    if names is not None:
        parts = dataset[()]
        values = np.empty(dataset.shape, dtype=np.complex128)
        values.real, values.imag = parts[names[0]], parts[names[1]]
        return values
    return dataset[()].astype(np.complex128 if dataset.dtype.kind == "c" else np.float64)


def _read_text(datasets: Mapping[str, h5py.Dataset], key: str) -> tuple[str, ...]:
    return read_texts(_dataset(datasets, key), key)


def _dataset(datasets: Mapping[str, h5py.Dataset], key: str) -> h5py.Dataset:
    if key not in datasets:
        raise SceneError(key, "missing", "give this dataset")
    dataset = datasets[key]
    if not dataset.shape:
        raise SceneError(key, "a single value or nothing", "give an array")
    return dataset
