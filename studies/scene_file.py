"""Scene files: a reduced model from any finite-element code, in HDF5.

Numbers may be of any integer or floating type; complex ones are compounds `{r, i}`, as h5py, PyTables and netCDF4 write
them, or `{real, imag}`, as Octave and MATLAB do. Text is UTF-8, of fixed or variable length. Files are read without
following anything out of them: external and soft links, external storage and virtual datasets are refused. Attributes
other than `n_sectors` and `nodal_diameter` are the user's own.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from solver.model import ComplexArray, ContactInterface, FloatArray, IntArray, LinearModel, Matrix, ReducedModel
from studies.model_check import check_model, check_sector, is_grouped
from studies.scene_error import SceneError

_CONTACT = ("dofs", "area", "gap", "normal_load", "position", "surface")
_LINEAR = ("mass", "damping", "stiffness", "load/static", "load/harmonic", "response/dofs", "response/names")
_DEEPEST = 4  # nd/<k>/load/static
_LARGEST = 2**31  # bytes: a dataset beyond is no reduced model


def write_scene(model: ReducedModel, path: str | Path) -> None:
    """Write a model as a scene file, complete or not at all; an existing file is replaced.

    Reading it gives the same model bit by bit. Raises SceneError where the model is impossible, OSError where the file
    cannot be written.
    """
    check_model(model)
    path = Path(path)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}.tmp")
    try:
        with h5py.File(unfinished, "w") as file:
            _write_model(model, file)
        os.replace(unfinished, path)
    finally:
        unfinished.unlink(missing_ok=True)


def read_scene(path: str | Path, n_harmonics: int = 1) -> ReducedModel:
    """Read and check a scene file.

    n_harmonics: harmonics 0..n_harmonics must find their nodal diameter in the file.

    Raises SceneError for wrong content, with the dataset as its key, and for a file that is not HDF5, with the key
    "model"; OSError where the file is missing or cannot be opened.
    """
    with Path(path).open("rb"):  # says why, where h5py only says that a file cannot be opened
        pass
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise SceneError("model", f"{path} is no HDF5 file, or damaged", "give a scene file in HDF5") from error
    with file:
        try:
            return _read_model(file, n_harmonics)
        except (OSError, RuntimeError) as error:
            raise SceneError("model", f"{path} is damaged", "write the scene file again") from error


def _write_model(model: ReducedModel, file: h5py.File) -> None:
    if model.n_sectors > 0:
        file.attrs["n_sectors"] = model.n_sectors
        file.attrs["nodal_diameter"] = model.nodal_diameter
    contact = model.contact
    for name in _CONTACT[:-1]:
        file[f"contact/{name}"] = getattr(contact, name)
    text = h5py.string_dtype("utf-8")
    file.create_dataset("contact/surface", data=list(contact.surface), dtype=text)
    for k, linear in model.linear.items():
        group = file.create_group(f"nd/{k}") if is_grouped(model) else file
        for name in ("mass", "damping", "stiffness"):
            group[name] = getattr(linear, name)
        group["load/static"] = linear.load_static
        group["load/harmonic"] = linear.load_harmonic
        group["response/dofs"] = linear.response
        group.create_dataset("response/names", data=list(model.response_names), dtype=text)


def _read_model(file: h5py.File, n_harmonics: int) -> ReducedModel:
    datasets = dict(_walk(file, ""))
    grouped = any(key.startswith("nd/") for key in datasets)
    _refuse_unknown(datasets, grouped)
    n_sectors, nodal_diameter = (_read_count(file, name, required=grouped) for name in ("n_sectors", "nodal_diameter"))
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
    model = ReducedModel(
        linear=linear,
        contact=_read_contact(datasets),
        response_names=first,
        n_sectors=n_sectors,
        nodal_diameter=nodal_diameter,
    )
    check_model(model, n_harmonics, grouped=grouped)
    return model


def _walk(group: h5py.Group, prefix: str) -> Iterable[tuple[str, h5py.Dataset]]:
    for name in group:
        key = f"{prefix}{name}"
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise SceneError(key, "a link", "store the data itself under this name")
        item = _open(group, name, key)
        if isinstance(item, h5py.Group) and key.count("/") < _DEEPEST - 1:
            yield from _walk(item, f"{key}/")
        elif isinstance(item, h5py.Dataset):
            if item.external or item.is_virtual:
                raise SceneError(key, "data in another file", "store the data in this file")
            yield key, item
        else:
            raise SceneError(key, "unknown", "remove it")


def _open(group: h5py.Group, name: str | bytes, key: str) -> h5py.HLObject:
    try:
        item = group[name]
        # A type without equivalent in NumPy only shows when it is asked for.
        return item if isinstance(item, h5py.Group) or item.dtype is not None else None
    except (KeyError, TypeError, ValueError) as error:
        raise SceneError(key, "damaged or of an unknown type", "write it again as numbers or text") from error


def _refuse_unknown(datasets: Iterable[str], grouped: bool) -> None:
    contact = {f"contact/{name}" for name in _CONTACT}
    for key in datasets:
        if key in contact or (grouped and key == "response/names"):
            continue
        dataset = key
        if grouped:
            group, number, *below = [*key.split("/"), ""]
            if group != "nd" or not number.isdecimal() or str(int(number)) != number:
                raise SceneError(key, "unknown dataset", "remove it, or move it into nd/<nodal diameter>/")
            dataset = "/".join(below[:-1])
        if dataset not in _LINEAR:
            raise SceneError(key, "unknown dataset", f"remove it, known are {', '.join([*sorted(contact), *_LINEAR])}")


def _read_count(file: h5py.File, name: str, *, required: bool) -> int:
    if name not in file.attrs:
        if required:
            raise SceneError(name, "missing", f"give the attribute {name} to a file with groups nd/<k>")
        return 0
    value = np.asarray(file.attrs[name])
    if value.size != 1 or value.dtype.kind not in "iuf" or value.item() != np.floor(value.item()):
        raise SceneError(name, str(value), "give a whole number as the attribute")
    return int(value.item())


def _read_linear(datasets: Mapping[str, h5py.Dataset], prefix: str, *, real: bool) -> LinearModel:
    stiffness = _read_matrix(datasets, f"{prefix}stiffness", real)
    response = _read_matrix(datasets, f"{prefix}response/dofs", real)
    if response.ndim == 1:
        response = _selection(f"{prefix}response/dofs", response, len(stiffness))
    damping_key = f"{prefix}damping"
    harmonic: ComplexArray = _read_numbers(datasets, f"{prefix}load/harmonic").astype(np.complex128)
    return LinearModel(
        mass=_read_matrix(datasets, f"{prefix}mass", real),
        damping=_read_matrix(datasets, damping_key, real) if damping_key in datasets else np.zeros(stiffness.shape),
        stiffness=stiffness,
        load_static=_read_real(datasets, f"{prefix}load/static"),
        load_harmonic=harmonic,
        response=response,
    )


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
    return ContactInterface(
        dofs=dofs,
        area=_read_real(datasets, "contact/area"),
        gap=gap,
        normal_load=normal_load,
        position=position,
        surface=_read_text(datasets, "contact/surface") if labelled else ("",) * n_contact,
    )


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
    names = dataset.dtype.names
    if names in (("r", "i"), ("real", "imag")):
        parts = dataset[()]
        if all(parts.dtype[name].kind in "iuf" for name in names):
            values = np.empty(dataset.shape, dtype=np.complex128)
            values.real, values.imag = parts[names[0]], parts[names[1]]
            return values
    if dataset.dtype.kind not in "iufc":
        raise SceneError(key, f"type {dataset.dtype}", "give numbers")
    return dataset[()].astype(np.complex128 if dataset.dtype.kind == "c" else np.float64)


def _read_text(datasets: Mapping[str, h5py.Dataset], key: str) -> tuple[str, ...]:
    dataset = _dataset(datasets, key)
    if h5py.check_string_dtype(dataset.dtype) is None or len(dataset.shape) != 1:
        raise SceneError(key, f"type {dataset.dtype} of shape {dataset.shape}", "give a row of text")
    try:
        return tuple(str(text) for text in dataset.asstr("utf-8")[()])
    except UnicodeDecodeError as error:
        raise SceneError(key, "text that is not UTF-8", "write it in UTF-8") from error


def _dataset(datasets: Mapping[str, h5py.Dataset], key: str) -> h5py.Dataset:
    if key not in datasets:
        raise SceneError(key, "missing", "give this dataset")
    dataset = datasets[key]
    if not dataset.shape:
        raise SceneError(key, "a single value or nothing", "give an array")
    if dataset.size * dataset.dtype.itemsize > _LARGEST:
        raise SceneError(key, f"shape {dataset.shape}", "reduce the model: the dataset has more than 2 GiB")
    return dataset
