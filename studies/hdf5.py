"""Reads HDF5 files of any program: types and sizes are checked before data are read, and errors are one sentence.

No link, external storage or virtual dataset is followed: what is missing behind these would be read as zeros.
"""

import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from studies.scene_error import SceneError

Datasets = Mapping[str, h5py.Dataset]
"""Datasets by name with the groups above."""

LARGEST_TOTAL = 2**31
"""Bytes of all datasets together: three real matrices of 9400 rows, or 14 nodal diameters of 500 pairs with damping as
coefficients."""


def is_hdf5(path: Path) -> bool:
    """Whether a file begins as HDF5 files do. Raises OSError where it cannot be read."""
    with path.open("rb") as file:
        return file.read(8) == b"\x89HDF\r\n\x1a\n"


@contextmanager
def open_hdf5(path: Path) -> Iterator[h5py.File]:
    """The file, open for reading; damage that shows in use is a SceneError about "model".

    Raises SceneError where it is no such file, OSError where it is missing or not readable.
    """
    with path.open("rb"):  # says why, where h5py only says that a file cannot be opened
        pass
    try:
        with h5py.File(path, "r") as file:
            yield file
    except SceneError:
        raise
    except (OSError, RuntimeError, ValueError, TypeError, KeyError, ArithmeticError, MemoryError, SystemError) as error:
        # the library has no one way to say that bytes make no sense, or that a filter is not there
        found = f"{path.name} is no HDF5 file, or damaged ({' '.join(str(error).split())})"
        raise SceneError("model", found, "give a scene file in HDF5, or write it again") from error


def find_datasets(group: h5py.Group) -> dict[str, h5py.Dataset]:
    """Datasets below a group, by name with the groups above, without those that only name a dimension.

    Raises SceneError where a dataset is stored elsewhere or of an unknown type, or all together are too large.
    """
    links: list[tuple[str, Any]] = []
    group.visititems_links(lambda name, link: links.append((name, link)))
    found: dict[str, h5py.Dataset] = {}
    total = 0
    for key, link in links:
        if not isinstance(link, h5py.HardLink):
            raise SceneError(key, "a link", "store the data itself under this name")
        try:
            item = group[key]
            # a type without equivalent in NumPy only shows when it is asked for
            kind = item.dtype if isinstance(item, h5py.Dataset) else None
        except (KeyError, TypeError, ValueError) as error:
            raise SceneError(key, "damaged or of an unknown type", "write it again as numbers or text") from error
        # a dimension without variable, in the sense of NetCDF
        if kind is None or (item.ndim == 1 and item.is_scale and "_Netcdf4Dimid" in item.attrs):
            continue
        if item.external or item.is_virtual:
            raise SceneError(key, "data in another file", "store the data in this file")
        # numbers become real or complex ones of double precision
        total += math.prod(item.shape or ()) * max(16 if kind.kind in "cV" else 8, kind.itemsize)
        if total > LARGEST_TOTAL:
            remedy = f"reduce the model: all datasets together may take {LARGEST_TOTAL / 2**30:g} GiB"
            raise SceneError(key, f"shape {item.shape} is too large", remedy)
        found[key] = item
    return found


def read_dataset(datasets: Datasets, key: str, kind: str) -> Any:
    """Values of a dataset: "any" numbers (float64 or complex128), "real" or "whole" ones, "flags", or a row of "text".

    Raises SceneError.
    """
    if key not in datasets:
        raise SceneError(key, "missing", "give this dataset")
    dataset = datasets[key]
    if not dataset.shape:
        raise SceneError(key, "a single value or nothing", "give an array")
    if kind == "text":
        if h5py.check_string_dtype(dataset.dtype) is None or dataset.ndim != 1:
            raise SceneError(key, f"type {dataset.dtype} of shape {dataset.shape}", "give a row of text")
        return tuple(_as_text(key, text) for text in dataset[()])
    type_, names = dataset.dtype, dataset.dtype.names
    if names in (("r", "i"), ("real", "imag")):
        is_number = all(type_[name].kind in "iuf" and not type_[name].shape for name in names)
    else:
        is_number = type_.kind in "iufc" and h5py.check_enum_dtype(type_) is None
    if not is_number:
        raise SceneError(key, f"type {type_}", "give numbers")
    values = dataset[()]
    if names is not None:
        parts, values = values, np.empty(dataset.shape, dtype=np.complex128)
        values.real, values.imag = parts[names[0]], parts[names[1]]
    values = values.astype(np.complex128 if values.dtype.kind == "c" else np.float64)
    if kind == "real" and np.iscomplexobj(values):
        raise SceneError(key, "complex", "give real numbers")
    if kind == "flags":
        if (wrong := values[(values != 0) & (values != 1)]).size:
            raise SceneError(key, str(wrong.flat[0]), "give 0 or 1")
        return np.asarray(values == 1)
    return as_whole(key, values) if kind == "whole" else values


def as_whole(key: str, values: Any) -> Any:
    """Whole numbers, which MATLAB writes as floating ones. Raises SceneError."""
    with np.errstate(invalid="ignore"):
        whole = values.real.astype(np.int64)
    if (wrong := values[whole != values]).size:
        raise SceneError(key, str(wrong.flat[0]), "give whole numbers")
    return whole


def read_attribute(group: h5py.HLObject, name: str) -> NDArray[np.generic] | None:
    """An attribute, a number or text of shape () or (1,); None where there is none. Raises SceneError."""
    if name not in group.attrs:
        return None
    attribute = group.attrs.get_id(name)
    kind = attribute.dtype
    if attribute.shape not in ((), (1,)) or (h5py.check_string_dtype(kind) is None and kind.kind not in "iuf"):
        raise SceneError(name, f"type {kind} of shape {attribute.shape}", "give a single value as the attribute")
    return np.asarray(group.attrs[name])


def read_text_attribute(group: h5py.HLObject, name: str) -> str:
    """A text that is an attribute, "" where there is none. Raises SceneError where it is no text in UTF-8."""
    value = read_attribute(group, name)
    return "" if value is None else _as_text(name, value.item())


def _as_text(key: str, value: object) -> str:
    try:
        text = value.decode("utf-8") if isinstance(value, bytes) else value
    except UnicodeDecodeError as error:
        raise SceneError(key, "text that is not UTF-8", "write it in UTF-8") from error
    if not isinstance(text, str):
        raise SceneError(key, str(text), "give a text")
    return text
