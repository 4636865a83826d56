"""Reads result files that nobody vouches for, with both libraries that read them afterwards, in a process of its own.

A result is an HDF5 file with conventions of NetCDF in its attributes, which the HDF5 library knows nothing of: lists of
references say which dimensions a variable has. They are looked at here before the NetCDF library follows them.
"""

from __future__ import annotations

from pathlib import Path

import h5py
import netCDF4

from studies.guards.hdf5_guard import (
    DEEPEST_RESULT,
    LARGEST_RESULT,
    LARGEST_TEXT,
    check_dataset,
    declared_bytes,
    only_names_a_dimension,
    open_hdf5,
    read_attribute,
    walk,
)
from studies.scene_error import SceneError

_LARGEST_READ = 2**23  # bytes of a variable that is read here; of larger ones their readers take parts
_MOST_VALUES = 10_000  # of an attribute
_REMEDY = "give a result file that is whole"


def read_result_through(path: Path) -> None:
    """Looks at all that a result file holds, and reads what is not large. Raises SceneError.

    Large variables are left to their readers, who take parts of them: their chunks are small.
    """
    try:
        with open_hdf5(path, LARGEST_RESULT) as file:
            _read_as_hdf5(file)
        with netCDF4.Dataset(path) as read:
            _read_as_netcdf(read)
    except SceneError:
        raise
    # what the libraries raise where a file is not what they expect: there is no list of it
    except Exception as error:
        raise SceneError("model", f"{path.name} is damaged", _REMEDY) from error


def _read_as_hdf5(file: h5py.File) -> None:
    for name in file.attrs:
        read_attribute(file, name)
    for key, item in walk(file, deepest=DEEPEST_RESULT):
        for name in item.attrs:
            _check_attribute(item, name, f"{key}:{name}")
        if isinstance(item, h5py.Dataset) and not only_names_a_dimension(item):
            check_dataset(item, key)
            if item.shape is not None and declared_bytes(item) < _LARGEST_READ:
                item[()]


def _check_attribute(item: h5py.HLObject, name: str, key: str) -> None:
    """Raises SceneError where an attribute of a group or dataset is not what NetCDF takes it for."""
    attribute = item.attrs.get_id(name)
    kind = attribute.dtype
    if name == "DIMENSION_LIST":
        rows = h5py.check_vlen_dtype(kind)
        if rows is None or h5py.check_ref_dtype(rows) is None or attribute.shape != (item.ndim,):
            raise SceneError(key, f"type {kind} of shape {attribute.shape}", _REMEDY)
        for scales in item.attrs[name]:
            if not len(scales) or not all(item.file[scale].is_scale for scale in scales):
                raise SceneError(key, "a dimension without a scale", _REMEDY)
    elif name == "REFERENCE_LIST":
        if len(attribute.shape) != 1 or kind.names != ("dataset", "dimension"):
            raise SceneError(key, f"type {kind} of shape {attribute.shape}", _REMEDY)
    elif h5py.check_string_dtype(kind) is None and kind.kind not in "iuf":
        raise SceneError(key, f"type {kind}", "give numbers or text")
    elif len(attribute.shape) > 1 or attribute.shape > (_MOST_VALUES,) or attribute.get_storage_size() > LARGEST_TEXT:
        raise SceneError(key, f"shape {attribute.shape}", "give a single value, or a short row of them")
    elif name in ("scale_factor", "add_offset") and (kind.kind not in "iuf" or attribute.shape not in ((), (1,))):
        raise SceneError(key, f"type {kind} of shape {attribute.shape}", "give a single number")
    elif name in ("_Netcdf4Dimid", "_Netcdf4Coordinates") and kind.kind not in "iu":
        raise SceneError(key, f"type {kind}", _REMEDY)
    elif name in ("CLASS", "NAME") and attribute.shape != ():
        raise SceneError(key, f"shape {attribute.shape}", _REMEDY)


def _read_as_netcdf(file: netCDF4.Dataset) -> None:
    """All attributes and what is not large, as it stands there: no value is scaled or masked."""
    file.set_auto_maskandscale(False)
    for name in file.ncattrs():
        file.getncattr(name)
    for variable in file.variables.values():
        for name in variable.ncattrs():
            variable.getncattr(name)
        # a text counts as the address of one
        size = variable.size * getattr(variable.dtype, "itemsize", 8)
        if size < _LARGEST_READ:
            variable[...]
