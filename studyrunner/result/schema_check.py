"""Schema check of a result file: known variables of the right dimensions, types and sizes; nothing else is read.

Texts of the file stay texts: they hold no control characters and no line breaks, and are as long as a sentence at most.

By hand: `xarray-schema` has no limits of sizes, and leaves texts as they are.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np
import xarray as xr

from studyrunner.coordinates import COORDINATES, SCENE, STUCK_FREQUENCY
from studyrunner.mission_variables import OF_A_MISSION, OF_MISSIONS
from studyrunner.mode_variables import OF_A_MODE_POINT, OF_MODES
from studyrunner.statistics.samples import DRAWN, SAMPLE
from studyrunner.study.toml_text import NoTomlError, read_toml
from studyrunner.user_error import UserError, Verbatim, show_text
from studyrunner.variables import ASKED, CERTIFICATE, COUNTS, KEPT, LOOPS, Variable

MOST_POINTS = 10**6
"""Largest number of points of a study."""

_MOST_VALUES = 2**27  # of a variable without contact pairs, which may be read as a whole
_MOST_NAMES = 2**20  # values along any dimension
_MOST_INPUTS, _MOST_DRAWN = 100, 2**24  # inputs that scatter, values of one of them
_LARGEST_READ = 2**24  # bytes
_LARGEST_NUMBER = 1e30
_INFINITE = ("_error", "error_estimate", "step_limit", "cycle_count", "last_cycle", *CERTIFICATE)
"""Ends of the names of variables that may be infinite: errors that are not known, what comes after any cycle."""
_LONGEST_NAME, _LONGEST_SENTENCE = 120, 400
_DEEPEST, _INTEGERS = 3, 2.0**63  # of what is nested in a study
_REMEDY = "give a result file of run-study that is whole"

_WITHOUT_AXES = SCENE["mesh"] | SCENE["natural_frequency"] | {"stuck_frequency": STUCK_FREQUENCY}
_WITH_AXES = ASKED | KEPT | LOOPS | COUNTS | SCENE["exact"]
_OF_CONTACTS = {name: entry for name, entry in COORDINATES.items() if entry.dimensions}
_TEXTS = ("scheme", "sweep", "response", "component", "block")
_MANY_LINES = ("study", "sentences")


class _WrongError(Exception):
    """A variable of a file is wrong. name: of the variable. found: what is wrong."""

    def __init__(self, name: str, found: str) -> None:
        super().__init__(name, found)
        self.name = name
        self.found = found


def check_dataset(dataset: xr.Dataset, source: str) -> xr.Dataset:
    """Variables of a file that the report knows. Only coordinates, texts and the mesh are read.

    Parameters
    ----------
    dataset
        The opened file.
    source
        Name of the file for the user.

    Raises
    ------
    UserError
        Where a needed variable is missing or has a wrong shape or type.
    """
    slow = "mission" if "mission" in dataset.dims else "cycle"
    lacking = [name for name in ("outcome", slow, "contact") if name not in dataset.variables]
    if lacking:
        raise UserError(source, "OUT.nc", None, f"holds no {' and no '.join(lacking)}; {_REMEDY}")
    axes = tuple(map(str, dataset["outcome"].dims))
    try:
        _check_sizes(dataset, axes, slow)
        coordinates = {name: _check_coordinate(dataset, name) for name in _coordinates(dataset, axes)}
        coordinates |= {name: _check_drawn(dataset, name, axes) for name in _drawn_names(dataset)}
        kept = _check_variables(dataset, axes, slow)
        coordinates |= {name: kept.pop(name) for name in _OF_CONTACTS if name in kept}
        _check_values(coordinates | kept, axes, slow)
    except _WrongError as wrong:
        raise UserError(source, wrong.name, Verbatim(wrong.found), _REMEDY) from None
    checked = xr.Dataset(kept, coordinates, {str(name): _clean(name, value) for name, value in dataset.attrs.items()})
    checked.set_close(dataset.close)
    study_tables(checked.attrs, source)
    return checked


def check_numbers(dataset: xr.Dataset, source: str) -> None:
    """Looks for numbers that are too large to be drawn. NaN is allowed.

    Variables that are too large to be read as a whole are not tested.

    Raises
    ------
    UserError
        Where there is such a number.
    """
    for name, variable in dataset.variables.items():
        if variable.dtype.kind == "f" and variable.size * variable.dtype.itemsize <= _LARGEST_READ:
            sizes = np.abs(variable.values)
            may_be_infinite = str(name).endswith(_INFINITE)
            wrong = sizes[(sizes > _LARGEST_NUMBER) & (np.isfinite(sizes) | (not may_be_infinite))]
            if wrong.size:
                raise UserError(source, str(name), Verbatim(f"{wrong[0]:g}"), _REMEDY)


@contextmanager
def reading_errors(source: str, *, every: bool = False) -> Iterator[None]:
    """Turns errors of the libraries about a damaged file into UserError. source: name of the file for the user.

    every: whether all errors are turned; for blocks that only read.
    """
    try:
        yield
    except UserError:
        raise
    except Exception as error:
        if every or (isinstance(error, OSError | RuntimeError) and "NetCDF:" in str(error)):
            raise UserError(source, "the file", Verbatim("damaged"), _REMEDY) from error
        raise


def study_tables(attributes: Mapping[str, object], source: str = "") -> dict[str, dict[str, object]]:
    """The effective study of a file, by table; empty where it is no TOML. Very deeply nested values are left out.

    Raises
    ------
    UserError
        Where the study is no text in UTF-8, too long, or nested too deeply.
    """
    try:
        tables = read_toml(str(attributes.get("study", "")).encode("utf-8", "replace"), source)
    except NoTomlError:
        return {}
    except UserError as error:
        raise UserError(source, "the attribute study", None, error.remedy) from None
    return {name: found for name, table in tables.items() if isinstance(found := _plain(table, _DEEPEST), dict)}


def _coordinates(dataset: xr.Dataset, axes: Sequence[str]) -> list[str]:
    """Names of the coordinates of the dimensions."""
    others = (name for name, entry in COORDINATES.items() if not entry.dimensions and name not in axes)
    return [*axes, *(name for name in others if name in dataset.variables and name in dataset.dims)]


def _check_sizes(dataset: xr.Dataset, axes: Sequence[str], slow: str) -> None:
    if not all(name.isidentifier() and len(name) <= _LONGEST_NAME for name in axes):
        raise _WrongError("outcome", "axes with unusual names")
    sizes = {str(name): size for name, size in dataset.sizes.items()}
    for name in (*axes, slow, "contact"):
        if not 0 < sizes.get(name, 0) <= _MOST_NAMES:
            raise _WrongError(name, f"{sizes.get(name, 0)} values")
    n_points = math.prod(sizes[name] for name in axes)
    n_values = n_points * sizes[slow] * sizes.get("response", 1) * (sizes.get("block", 1) if slow == "mission" else 1)
    if n_points > MOST_POINTS or n_values > _MOST_VALUES:
        raise _WrongError("outcome", f"{n_points} points, {sizes[slow]} counts of {slow}s")


def _check_coordinate(dataset: xr.Dataset, name: str) -> xr.Variable:
    """Values along the dimension of this name: finite numbers, or texts."""
    if name not in dataset.variables or dataset.variables[name].dims != (name,):
        raise _WrongError(name, "no values along the dimension of this name")
    variable = dataset.variables[name]
    if variable.dtype.kind not in "iuf":
        texts = _texts(variable, name)
        if name in COORDINATES and name not in _TEXTS and not all(map(_is_choice, texts.values.tolist())):
            raise _WrongError(name, "texts in place of numbers")
        return texts
    if name in ("scheme", "sweep"):
        raise _WrongError(name, "numbers in place of words")
    if not np.isfinite(variable.values).all():
        raise _WrongError(name, "a value that is no finite number")
    return xr.Variable((name,), variable.values, _attributes(variable))


def _is_choice(text: str) -> bool:
    """Whether a text stands for a number: the values of an axis with numbers and "auto" are texts."""
    try:
        return text == "auto" or math.isfinite(float(text))
    except ValueError:
        return False


def _drawn_names(dataset: xr.Dataset) -> list[str]:
    """Coordinates with what samples draw."""
    found = [str(name) for name in dataset.variables if str(name).startswith(DRAWN)]
    if len(found) > _MOST_INPUTS or not all(name.isidentifier() and len(name) <= _LONGEST_NAME for name in found):
        raise _WrongError(found[0], f"{len(found)} inputs that scatter, or unusual names")
    return found


def _check_drawn(dataset: xr.Dataset, name: str, axes: Sequence[str]) -> xr.Variable:
    """What the samples draw of an input: finite numbers along the samples, and along an axis before them.

    Or of each pair, then along any axes; NaN where a scene does not have a pair.
    """
    variable = dataset.variables[name]
    of_pairs, along = variable.dims[-1:] == ("contact",), [each for each in variable.dims if each != "contact"]
    in_order = along == [axis for axis in axes if axis in along] and along[-1:] == [SAMPLE]
    if not in_order or variable.ndim != len(along) + of_pairs or (len(along) > 2 and not of_pairs):
        raise _WrongError(name, f"dimensions {', '.join(map(str, variable.dims))}")
    if variable.dtype.kind != "f" or variable.size > _MOST_DRAWN:
        raise _WrongError(name, f"type {variable.dtype} of shape {variable.shape}")
    is_right = np.abs(variable.values) < _LARGEST_NUMBER
    if of_pairs:
        is_right = is_right.any(axis=-1, keepdims=True) & (is_right | np.isnan(variable.values))
    if not is_right.all():
        raise _WrongError(name, "a value that is no finite number")
    return xr.Variable(variable.dims, variable.values, _attributes(variable))


def _check_variables(dataset: xr.Dataset, axes: Sequence[str], slow: str) -> dict[str, xr.Variable]:
    """Those that the report knows, unread but for texts."""
    with_axes: dict[str, Variable] = OF_MISSIONS | OF_A_MISSION if slow == "mission" else _WITH_AXES
    if "modal_amplitude" in axes:
        with_axes = OF_MODES | OF_A_MODE_POINT
    kept = {}
    for name, entry in (_WITHOUT_AXES | _OF_CONTACTS | with_axes).items():
        if name in dataset.variables:
            # what is of the scene has those axes along which scenes differ
            along = tuple(axis for axis in axes if name in with_axes or axis in dataset.variables[name].dims)
            kept[name] = _check_variable(dataset.variables[name], name, entry, (*along, *entry.dimensions))
    return kept


def _check_variable(variable: xr.Variable, name: str, entry: Variable, dimensions: tuple[str, ...]) -> xr.Variable:
    if variable.dims != dimensions:
        raise _WrongError(name, f"dimensions {', '.join(map(str, variable.dims))}")
    if {"scale_factor", "add_offset"} & set(variable.encoding):
        raise _WrongError(name, "packed values")
    if entry.is_text or entry.dtype == "str" or name == "contact_surface":
        return _texts(variable, name)
    if variable.dtype.kind not in ("iuf" if entry.dtype.startswith("float") else "iu"):
        raise _WrongError(name, f"type {variable.dtype}")
    variable = variable.copy(deep=False)
    variable.attrs = _attributes(variable)
    return variable


def _check_values(kept: Mapping[str, xr.Variable], axes: Sequence[str], slow: str) -> None:
    """Tests the values that lead to other values: cycles or missions, pairs, flags and mesh."""
    # worn joints whose modes are sought stand in any order
    cycles = np.sort(kept[slow].values) if slow in axes else kept[slow].values
    if cycles.dtype.kind not in "iuf" or cycles[0] < 0 or (np.diff(cycles) <= 0).any():
        raise _WrongError(slow, "no counts in ascending order")
    pairs = kept["contact"].values
    if pairs.dtype.kind not in "iu" or len(set(pairs.tolist())) < pairs.size:
        raise _WrongError("contact", "no whole numbers that differ")
    if np.atleast_1d(kept["outcome"].attrs.get("flag_values", np.zeros(0, int))).dtype.kind not in "iu":
        raise _WrongError("outcome:flag_values", "no whole numbers")
    if not all(np.isfinite(kept[name].values).all() for name in kept if name in ("mesh_x", "mesh_y", "mesh_z")):
        raise _WrongError("mesh_x", "no finite number, here or beside it")
    if "mesh_quad" in kept:
        n_nodes = min((kept[f"mesh_{axis}"].size for axis in "xyz" if f"mesh_{axis}" in kept), default=0)
        quad = kept["mesh_quad"]
        if quad.size > _MOST_VALUES or ((quad.values < 0) | (quad.values >= n_nodes)).any():
            raise _WrongError("mesh_quad", "nodes that there are not")


def _texts(variable: xr.Variable, name: str) -> xr.Variable:
    if variable.dtype.kind not in "OSU" or variable.size > _MOST_NAMES:
        raise _WrongError(name, f"type {variable.dtype} of shape {variable.shape}")
    longest = _LONGEST_SENTENCE if name == "message" else _LONGEST_NAME
    texts = [_line(each, longest) for each in variable.values.flat]
    values = np.array(texts, dtype=np.str_).reshape(variable.shape)
    return xr.Variable(variable.dims, values, _attributes(variable))


def _attributes(variable: xr.Variable) -> dict[str, object]:
    """Attributes that the report reads."""
    named = ("units", "long_name", "flag_meanings", "sentences")
    kept: dict[str, object] = {name: _clean(name, variable.attrs[name]) for name in named if name in variable.attrs}
    return kept | {name: variable.attrs[name] for name in ("flag_values",) if name in variable.attrs}


def _clean(name: object, value: object) -> str:
    """Text of an attribute without control characters."""
    if name in _MANY_LINES:
        return show_text(value.decode("utf-8", "backslashreplace") if isinstance(value, bytes) else str(value))
    longest = {"units": _LONGEST_NAME, "flag_meanings": 50 * _LONGEST_SENTENCE}.get(str(name), _LONGEST_SENTENCE)
    return _line(value, longest)


@functools.lru_cache(maxsize=4096)  # most messages are the same
def _line(value: object, longest: int) -> str:
    """Text in one line, without control characters. longest: number of characters."""
    text = value.decode("utf-8", "backslashreplace") if isinstance(value, bytes) else str(value)
    text = show_text(" ".join(text[: 2 * longest].split()))
    return text if len(text) <= longest else f"{text[: longest - 1]}…"


def _plain(value: object, deepest: int) -> object:
    """A value of a study for text and arithmetic; None where it is nested too deeply."""
    if isinstance(value, int) and not isinstance(value, bool):
        return value if abs(value) < _INTEGERS else math.copysign(math.inf, value)
    if isinstance(value, dict | list) and deepest == 0:
        return None
    if isinstance(value, dict):
        return {_line(name, _LONGEST_NAME): _plain(item, deepest - 1) for name, item in value.items()}
    if isinstance(value, list):
        return [_plain(item, deepest - 1) for item in value]
    return value if isinstance(value, bool | float) else _line(value, _LONGEST_NAME)
