"""Opens HDF5 files of unknown origin: their structure is checked before data are read.

No reference out of the file is followed: external, soft and user-defined links, external storage and virtual datasets
are refused. So are types other than numbers and text, filters that need a plug-in, and sizes that exceed the file.
Damaged bytes may crash the library; this is tested in a separate process, see `studies.sandboxed_read`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from studies.scene_error import SceneError

LARGEST_TOTAL = 2**31
"""Bytes of all datasets together: three real matrices of 9400 rows, or 14 nodal diameters of 500 pairs with damping as
coefficients."""

LARGEST_FILE = 2**32
"""Largest size of a file, bytes."""

LARGEST_RESULT = 2**40
"""Largest size of a result file, bytes, which contains the scene."""

LARGEST_TEXT = 4 * 2**20
"""Largest size of all texts of a dataset or attribute, bytes."""

_WITHOUT_PROOF = 2**26  # bytes that a file of any size may hold once it is unpacked
_PACKED = 20.0  # and beyond that how many times its own size
_LARGEST_CHUNK = 2**25
_OF_NETCDF = ("_NCProperties", "_nc3_strict")
_MOST_CHUNKS = 100_000
_MOST_OBJECTS = 2000
_DEEPEST = 4  # of groups and datasets within each other: nd/<k>/load/static
DEEPEST_RESULT = 5
"""Deepest level of groups in a result, which contains its scene in a group."""

_LONGEST_NAME = 100
_FILTERS = (h5py.h5z.FILTER_DEFLATE, h5py.h5z.FILTER_SHUFFLE, h5py.h5z.FILTER_FLETCHER32, h5py.h5z.FILTER_LZF)


def open_hdf5(path: Path, largest: int = LARGEST_FILE) -> h5py.File:
    """The file, of at most `largest` bytes, open for reading.

    Raises
    ------
    SceneError
        Where it is none.
    OSError
        Where it is missing or not readable.
    """
    with path.open("rb"):  # says why, where h5py only says that a file cannot be opened
        pass
    if path.stat().st_size > largest:
        raise SceneError("model", f"{path.name} is larger than {largest / 2**30:g} GiB", "reduce the model")
    try:
        return h5py.File(path, "r")
    except (OSError, RuntimeError, ValueError) as error:
        raise SceneError("model", f"{path.name} is no HDF5 file, or damaged", "give a scene file in HDF5") from error


def find_group(file: h5py.File, name: str) -> h5py.Group:
    """A group of a file. Raises SceneError where there is none."""
    if not isinstance(file.get(name, getlink=True), h5py.HardLink) or not isinstance(file[name], h5py.Group):
        raise SceneError(name, "missing", f"give a file with a group {name}")
    return file[name]


def find_datasets(group: h5py.Group, file_size: int) -> dict[str, h5py.Dataset]:
    """Datasets below a group, by name with the groups above; each can be read safely.

    Datasets that only name a dimension, and named types, are left out.

    Raises
    ------
    SceneError
        Where a dataset is not what it declares, or all together are too large.
    """
    walked = walk(group)
    found = {key: item for key, item in walked if isinstance(item, h5py.Dataset) and not only_names_a_dimension(item)}
    allowed = min(LARGEST_TOTAL, _WITHOUT_PROOF + _PACKED * file_size)
    for key, dataset in found.items():
        check_dataset(dataset, key)
        allowed -= declared_bytes(dataset)
        if allowed < 0:
            remedy = f"reduce the model to {LARGEST_TOTAL / 2**20:g} MiB, and compress it by no more than {_PACKED:g}"
            raise SceneError(key, f"shape {dataset.shape} is too much for this file", remedy)
    return found


def check_dataset(dataset: h5py.Dataset, key: str) -> None:
    """Raises SceneError where a dataset is not what it declares, or refers to data out of the file."""
    if dataset.external or dataset.is_virtual:
        raise SceneError(key, "data in another file", "store the data in this file")
    if not is_number(dataset.dtype) and h5py.check_string_dtype(dataset.dtype) is None:
        raise SceneError(key, f"type {dataset.dtype}", "give numbers or text")
    properties = dataset.id.get_create_plist()
    filters = [properties.get_filter(place)[0] for place in range(properties.get_nfilters())]
    if len(set(filters)) < len(filters) or not set(filters) <= set(_FILTERS):
        raise SceneError(key, "an unusual filter", "write it uncompressed, or with gzip or LZF")
    if dataset.chunks is None:
        return
    if _bytes(dataset.chunks, dataset.dtype) > _LARGEST_CHUNK:
        raise SceneError(key, f"chunks {dataset.chunks}", f"give chunks of at most {_LARGEST_CHUNK / 2**20:g} MiB")
    if (
        math.prod(-(-length // chunk) for length, chunk in zip(dataset.shape, dataset.chunks, strict=True))
        > _MOST_CHUNKS
    ):
        raise SceneError(key, f"shape {dataset.shape} in chunks {dataset.chunks}", "give larger chunks, or none")


def is_number(kind: np.dtype[Any]) -> bool:
    """Whether a type is that of real or complex numbers."""
    names = kind.names
    if names in (("r", "i"), ("real", "imag")):
        return all(kind[name].kind in "iuf" and not kind[name].shape for name in names)
    return kind.kind in "iufc" and h5py.check_enum_dtype(kind) is None


def read_texts(dataset: h5py.Dataset, key: str) -> tuple[str, ...]:
    """A row of texts in UTF-8, one by one: several may stand for the same bytes, which take room each time."""
    if h5py.check_string_dtype(dataset.dtype) is None or dataset.ndim != 1:
        raise SceneError(key, f"type {dataset.dtype} of shape {dataset.shape}", "give a row of text")
    texts: list[str] = []
    left = LARGEST_TEXT
    for place in range(len(dataset)):
        item = dataset[place]
        raw = item if isinstance(item, bytes) else str(item).encode()
        left -= len(raw)
        if left < 0:
            raise SceneError(key, "texts", f"give texts of together at most {LARGEST_TEXT / 2**20:g} MiB")
        try:
            texts.append(raw.decode("utf-8"))
        except UnicodeDecodeError as error:
            raise SceneError(key, "text that is not UTF-8", "write it in UTF-8") from error
    return tuple(texts)


def read_attribute(group: h5py.Group, name: str) -> NDArray[np.generic] | None:
    """A number or text that is an attribute, of shape () or (1,), None where there is none. Raises SceneError."""
    if name not in group.attrs:
        return None
    attribute = group.attrs.get_id(name)
    kind = attribute.dtype
    texts = h5py.check_string_dtype(kind)
    if name in _OF_NETCDF:
        return None
    if attribute.shape not in ((), (1,)) or (texts is None and kind.kind not in "iuf"):
        raise SceneError(name, f"type {kind} of shape {attribute.shape}", "give a single value as the attribute")
    if attribute.get_storage_size() > LARGEST_TEXT and (texts is None or texts.length is not None):
        raise SceneError(name, "too long", "give a single value as the attribute")
    return np.asarray(group.attrs[name])


def walk(
    group: h5py.Group, prefix: str = "", seen: list[int] | None = None, deepest: int = _DEEPEST
) -> Iterator[tuple[str, h5py.HLObject]]:
    """All groups and datasets below a group by name with the groups above; no link is followed.

    Parameters
    ----------
    group
        The group, or the file.
    prefix
        Names of the groups above, each with a slash behind it.
    seen
        How many objects were met on the way, counted on.
    deepest
        How many groups and datasets may lie within each other.

    Raises
    ------
    SceneError
        Where there are too many objects, or one is neither group nor dataset.
    """
    seen = [0] if seen is None else seen
    for name in group:
        seen[0] += 1
        key = f"{prefix}{name}"
        if seen[0] > _MOST_OBJECTS:
            raise SceneError(key, f"more than {_MOST_OBJECTS} objects", "remove what is no part of the scene")
        if len(name) > _LONGEST_NAME:
            raise SceneError(key[:_LONGEST_NAME], "a long name", f"give names of at most {_LONGEST_NAME} characters")
        if not isinstance(group.get(name, getlink=True), h5py.HardLink):
            raise SceneError(key, "a link", "store the data itself under this name")
        item = _open(group, name, key)
        if isinstance(item, h5py.Group) and key.count("/") < deepest - 1:
            yield key, item
            yield from walk(item, f"{key}/", seen, deepest)
        elif isinstance(item, h5py.Dataset):
            yield key, item
        elif not isinstance(item, h5py.Datatype):
            raise SceneError(key, "unknown", "remove it")


def only_names_a_dimension(item: h5py.HLObject) -> bool:
    """Whether a dataset is a dimension without variable, in the sense of NetCDF."""
    return (
        isinstance(item, h5py.Dataset)
        and item.ndim == 1
        and item.is_scale
        and "_Netcdf4Dimid" in item.attrs
        and "NAME" in item.attrs
    )


def _open(group: h5py.Group, name: str | bytes, key: str) -> h5py.HLObject:
    try:
        item = group[name]
        # A type without equivalent in NumPy only shows when it is asked for.
        return item if isinstance(item, h5py.Group) or item.dtype is not None else None
    except (KeyError, TypeError, ValueError) as error:
        raise SceneError(key, "damaged or of an unknown type", "write it again as numbers or text") from error


def declared_bytes(dataset: h5py.Dataset) -> int:
    """Memory of the values of a dataset, bytes, as numbers of 8 bytes or complex numbers of 16 at least."""
    kind = dataset.dtype
    if not is_number(kind):
        return _bytes(dataset.shape or (), kind)
    return _bytes(dataset.shape or (), np.dtype("c16" if kind.kind in "cV" else "f8"))


def _bytes(shape: tuple[int, ...], kind: np.dtype[Any]) -> int:
    # in whole numbers of Python, which do not overflow
    size = max(1, kind.itemsize)
    for length in shape:
        size *= int(length)
    return size
