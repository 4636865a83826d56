"""Reads HDF5 files of any program: types and sizes are checked before data are read, and errors are one sentence.

No link, external storage or virtual dataset is followed: what is missing behind these would be read as zeros.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from studies.scene_error import SceneError

LARGEST_TOTAL = 2**31
"""Bytes of all datasets together: three real matrices of 9400 rows, or 14 nodal diameters of 500 pairs with damping as
coefficients."""

_OF_NETCDF = ("_NCProperties", "_nc3_strict")


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
        file = h5py.File(path, "r")
    except (OSError, RuntimeError, ValueError) as error:
        raise SceneError("model", f"{path.name} is no HDF5 file, or damaged", "give a scene file in HDF5") from error
    try:
        with file:
            yield file
    except SceneError:
        raise
    except (OSError, RuntimeError, ValueError, TypeError, KeyError, ArithmeticError, MemoryError, SystemError) as error:
        # the library has no one way to say that bytes make no sense, or that a filter is not there
        reason = " ".join(str(error).split())
        raise SceneError("model", f"{path.name} is damaged ({reason})", "write the file again") from error


def find_datasets(group: h5py.Group) -> dict[str, h5py.Dataset]:
    """Datasets below a group, by name with the groups above.

    Datasets that only name a dimension, and named types, are left out. Raises SceneError where a dataset is stored
    elsewhere, has another type than numbers and text, or all together are too large.
    """
    links: list[tuple[str, Any]] = []
    group.visititems_links(lambda name, link: links.append((name, link)))
    found: dict[str, h5py.Dataset] = {}
    total = 0
    for key, link in links:
        if not isinstance(link, h5py.HardLink):
            raise SceneError(key, "a link", "store the data itself under this name")
        item = _open(group, key)
        if not isinstance(item, h5py.Dataset) or _only_names_a_dimension(item):
            continue
        if item.external or item.is_virtual:
            raise SceneError(key, "data in another file", "store the data in this file")
        total += _bytes_in_memory(item)
        if total > LARGEST_TOTAL:
            remedy = f"reduce the model: all datasets together may take {LARGEST_TOTAL / 2**30:g} GiB"
            raise SceneError(key, f"shape {item.shape} is too large", remedy)
        found[key] = item
    return found


def is_number(kind: np.dtype[Any]) -> bool:
    """Whether a type is that of real or complex numbers."""
    names = kind.names
    if names in (("r", "i"), ("real", "imag")):
        return all(kind[name].kind in "iuf" and not kind[name].shape for name in names)
    return kind.kind in "iufc" and h5py.check_enum_dtype(kind) is None


def read_texts(dataset: h5py.Dataset, key: str) -> tuple[str, ...]:
    """A row of texts in UTF-8. Raises SceneError."""
    if h5py.check_string_dtype(dataset.dtype) is None or dataset.ndim != 1:
        raise SceneError(key, f"type {dataset.dtype} of shape {dataset.shape}", "give a row of text")
    try:
        return tuple(text if isinstance(text, str) else text.decode("utf-8") for text in dataset[()])
    except UnicodeDecodeError as error:
        raise SceneError(key, "text that is not UTF-8", "write it in UTF-8") from error


def read_attribute(group: h5py.HLObject, name: str) -> NDArray[np.generic] | None:
    """A number or text that is an attribute, of shape () or (1,), None where there is none. Raises SceneError."""
    if name not in group.attrs or name in _OF_NETCDF:
        return None
    attribute = group.attrs.get_id(name)
    kind = attribute.dtype
    if attribute.shape not in ((), (1,)) or (h5py.check_string_dtype(kind) is None and kind.kind not in "iuf"):
        raise SceneError(name, f"type {kind} of shape {attribute.shape}", "give a single value as the attribute")
    return np.asarray(group.attrs[name])


def read_text_attribute(group: h5py.HLObject, name: str) -> str:
    """A text that is an attribute, "" where there is none. Raises SceneError where it is no text in UTF-8."""
    value = read_attribute(group, name)
    text = "" if value is None else value.item()
    if isinstance(text, bytes):
        try:
            text = text.decode("utf-8")
        except UnicodeDecodeError as error:
            raise SceneError(name, "text that is not UTF-8", "write it in UTF-8") from error
    if not isinstance(text, str):
        raise SceneError(name, str(text), "give a text")
    return text


def _open(group: h5py.Group, key: str) -> h5py.HLObject:
    try:
        item = group[key]
        # a type without equivalent in NumPy only shows when it is asked for
        kind = item.dtype if isinstance(item, h5py.Dataset) else None
    except (KeyError, TypeError, ValueError) as error:
        raise SceneError(key, "damaged or of an unknown type", "write it again as numbers or text") from error
    if kind is not None and not is_number(kind) and h5py.check_string_dtype(kind) is None:
        raise SceneError(key, f"type {kind}", "give numbers or text")
    return item


def _only_names_a_dimension(item: h5py.Dataset) -> bool:
    """Whether a dataset is a dimension without variable, in the sense of NetCDF."""
    return item.ndim == 1 and item.is_scale and "_Netcdf4Dimid" in item.attrs and "NAME" in item.attrs


def _bytes_in_memory(dataset: h5py.Dataset) -> int:
    """Memory of the values, as numbers of 8 bytes or complex numbers of 16 at least; in whole numbers of Python."""
    kind = dataset.dtype
    size = int(kind.itemsize)
    if is_number(kind):
        size = 16 if kind.kind in "cV" else 8
    for length in dataset.shape or ():
        size *= int(length)
    return size
