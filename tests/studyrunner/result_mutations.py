"""Result files with parts that are not what they were: attributes, values, types, dimensions, whole variables."""

import contextlib
import random
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np

from tests.studyrunner.results import build_file

NUMBERS = (0, 1, -1, 127, -128, 2**31 - 1, 2**62, -(2**63))
VALUES = (0.0, -0.0, 1.0, -1.0, np.nan, np.inf, -np.inf, 1e308, -1e308, 5e-324, 1e30, 1e-30, 2.0**63)
TEXTS = (
    *("", " ", "$\\bad{$", "$$", "_", "\\x", "<script>alert(1)</script>", "[/red]", "{0}", "%s", "\x1b[2J", "\x01"),
    *("é" * 50, "\u202e", "\U0001f9f1", "x" * 5000, "a\nb", "nan", "1e400", "auto", "implicit", "-1", "m3", "Pa"),
    *("a." * 500 + "a = 1", "a = " + "[" * 300, "a = " + "9" * 5000, "[solver]\nrtol = " + "9" * 400),
    *("[solver]\nrtol = 'x'\n[outputs]\nloops = 1", "[scene]\nmodel = []\nnodal_diameter = 99999999999999999999"),
    *("solver = 1\nscene = 2\nslow_time = 3\noutputs = 4", "[solver]\nrtol = -1\nshortcuts = 'x'\n[scene]\nmodel = 1"),
)


def write_result(path: Path) -> None:
    """A whole result, small, with all that is drawn but error against run time."""
    axes = {"frequency": (190.0, 191.0), "scheme": ("implicit", "explicit"), "sweep": ("up",), "step": (1000.0,)}
    made = build_file(axes=axes, cycles=(0.0, 100.0, 200.0), failed=(3,), loops=(0,))
    made["natural_frequency"] = (("nodal_diameter", "mode"), np.array([[1.0, 2.0], [3.0, 4.0]]))
    made = made.assign_coords(nodal_diameter=[0, 1], mode=[0, 1])
    for axis, places in zip("xyz", ((0.0, 1.0, 1.0, 0.0), (0.0, 0.0, 1.0, 1.0), (0.0,) * 4), strict=True):
        made[f"mesh_{axis}"] = ("mesh_node", np.array(places))
    made["mesh_quad"] = (("mesh_quad_index", "mesh_corner"), np.arange(4, dtype=np.int32)[None])
    made["mesh_part"] = ("mesh_quad_index", np.array(["disk"]))
    made.to_netcdf(path)


def mutate_result(path: Path, chance: random.Random) -> None:
    """Changes the file in up to three places; what the library does not do is left as it is."""
    for _ in range(chance.choice([1, 1, 2, 3])):
        with contextlib.suppress(Exception), h5py.File(path, "r+") as file:
            name = chance.choice(sorted(file))
            chance.choice(CHANGES)(file, name, chance)


def _values(file: h5py.File, name: str, chance: random.Random) -> None:
    """Some values, or all."""
    dataset = file[name]
    place = ... if chance.random() < 0.3 else tuple(chance.randrange(length) for length in dataset.shape)
    if h5py.check_string_dtype(dataset.dtype) is not None:
        dataset[place] = chance.choice(TEXTS)
    else:
        dataset[place] = chance.choice(VALUES if dataset.dtype.kind == "f" else NUMBERS)


def _attribute(file: h5py.File, name: str, chance: random.Random) -> None:
    """An attribute of a variable or of the file is another one, or gone."""
    owner = file if chance.random() < 0.3 else file[name]
    if not len(owner.attrs):
        return
    key = chance.choice(sorted(owner.attrs))
    values = (1, 1.5, "text", b"\xff\xfe", np.arange(3), np.arange(3.0), np.zeros((2, 2)), np.array(["a", "b"], "S1"))
    value = chance.choice([None, chance.choice(TEXTS), chance.choice(values)])
    del owner.attrs[key]
    if isinstance(value, str):
        owner.attrs.create(key, value, dtype=h5py.string_dtype("utf-8"))
    elif value is not None:
        owner.attrs[key] = value


def _new_attribute(file: h5py.File, name: str, chance: random.Random) -> None:
    """One that libraries obey."""
    keys = ("scale_factor", "add_offset", "_FillValue", "missing_value", "_Unsigned", "dtype", "_Encoding")
    contents = (1, 0.0, np.nan, "true", "bool", "x y z", np.arange(2), 1e308)
    file[name].attrs[chance.choice(keys)] = chance.choice(contents)


def _type(file: h5py.File, name: str, chance: random.Random) -> None:
    """Another type, the dimensions as before."""
    content = chance.choice([1, 0.5, 1j, "text", b"text", True, np.uint64(2**63), np.float16(1), np.datetime64(0, "s")])
    replace_variable(file, name, np.full(file[name].shape, content), file[name].ndim)


def _shape(file: h5py.File, name: str, chance: random.Random) -> None:
    """Another shape, or the same with fewer of its dimensions told."""
    shape = list(file[name].shape)
    way = chance.randrange(4)
    if way == 0 and shape:
        shape.pop(chance.randrange(len(shape)))
    elif way == 1:
        shape.append(chance.choice([0, 1, 3]))
    elif way == 2 and shape:
        shape[chance.randrange(len(shape))] = chance.choice([0, 1, 5, 100_000])
    replace_variable(file, name, np.zeros(shape), chance.randrange(len(shape) + 1))


def _remove(file: h5py.File, name: str, _chance: random.Random) -> None:
    del file[name]


def _swap(file: h5py.File, name: str, chance: random.Random) -> None:
    """Two variables under each other's names."""
    other = chance.choice(sorted(file))
    file.move(name, "between")
    file.move(other, name)
    file.move("between", other)


def _dimension(file: h5py.File, name: str, chance: random.Random) -> None:
    """Dimensions that are those of others."""
    dataset = file[name]
    other = file[chance.choice(sorted(file))]
    for key in ("DIMENSION_LIST", "_Netcdf4Coordinates", "_Netcdf4Dimid", "REFERENCE_LIST", "CLASS", "NAME"):
        if key in dataset.attrs and chance.random() < 0.4:
            del dataset.attrs[key]
            if key in other.attrs and chance.random() < 0.5:
                kind = other.attrs.get_id(key).dtype
                dataset.attrs.create(key, other.attrs[key], dtype=kind)
            elif chance.random() < 0.5:
                dataset.attrs[key] = chance.choice(NUMBERS)


def replace_variable(file: h5py.File, name: str, content: np.ndarray, n_told: int) -> None:
    """Another content of a variable, of whose dimensions the first are told."""
    old = file[name]
    scales = [list(dimension.values()) for dimension in old.dims]
    kept = {key: old.attrs[key] for key in ("_Netcdf4Coordinates", "units", "flag_values") if key in old.attrs}
    if content.dtype.kind == "U":
        content = content.astype(object)
    del file[name]
    new = file.create_dataset(name, data=content)
    new.attrs.update(kept)
    for number in range(min(n_told, len(scales))):
        for scale in scales[number]:
            new.dims[number].attach_scale(scale)


CHANGES: tuple[Callable[[h5py.File, str, random.Random], None], ...] = (
    *(_values, _values, _values, _attribute, _attribute, _new_attribute, _type, _shape, _remove, _swap, _dimension),
)
