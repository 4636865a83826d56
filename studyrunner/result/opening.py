"""Opens result files: the one way to read a result, after a check of its sizes, dimensions and types.

Texts of the file stay texts: without control characters and line breaks, and as long as a sentence at most.

By hand: `xarray-schema` has no limits of sizes, and leaves texts as they are.
"""

from __future__ import annotations

import functools
import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from studyrunner.coordinates import COORDINATES, SCENE, STUCK_FREQUENCY
from studyrunner.statistics.samples import DRAWN, SAMPLE
from studyrunner.study.study_of_result import check_result_file
from studyrunner.study.toml_text import read_toml
from studyrunner.user_error import UserError, Verbatim, show_text
from studyrunner.variables import (
    ASKED,
    CERTIFICATE,
    COUNTS,
    KEPT,
    LOOPS,
    OF_A_MISSION,
    OF_A_MODE_POINT,
    OF_MISSIONS,
    OF_MODES,
    Variable,
)

ENDED = "ended"
"""Coordinate of an opened result: `outcome` in words."""

_MOST_POINTS = 10**6
_MOST_VALUES = 2**27  # of a variable without contact pairs, which may be read as a whole
_MOST_NAMES = 2**20  # values along any dimension
_LARGEST_READ = 2**24  # bytes
_LARGEST_NUMBER = 1e30
_INFINITE = ("_error", "error_estimate", "step_limit", "cycle_count", "last_cycle", *CERTIFICATE)
"""Ends of the names of variables that may be infinite: errors that are not known, what comes after any cycle."""
_ATTRIBUTES = ("units", "long_name", "flag_meanings", "sentences", "flag_values")  # of variables, for the report
_LONGEST_NAME, _LONGEST_SENTENCE = 120, 400
_REMEDY = "give a result file of run-study that is whole"

_OF_SCENE = SCENE["mesh"] | SCENE["natural_frequency"] | {"stuck_frequency": STUCK_FREQUENCY}
_OF_SCENE |= {name: entry for name, entry in COORDINATES.items() if entry.dimensions}
_WORDS = ("scheme", "sweep")
_TEXTS = (*_WORDS, "response", "component", "block")
_DRAWN_VALUES = Variable((), "1", "what the samples draw of an input")


class _WrongError(Exception):
    """A variable of a file is wrong. name: of the variable. found: what is wrong."""

    def __init__(self, name: str, found: str) -> None:
        super().__init__(name, found)
        self.name = name
        self.found = found


def open_result(path: str | Path) -> xr.Dataset:
    """Open a result file after a check that it is a result of `run-study`: sizes, dimensions and types.

    The dataset is that of `xarray.open_dataset(path)`, read when it is needed. Two things are added: the coordinate
    `ended`, which is `outcome` in words; and loops have the dimension `loop_contact`, the pairs that have loops, in
    place of `contact`. The file stays open until the dataset is closed: use it in a `with` statement, or call its
    `load` and `close`. A file that is replaced meanwhile, by another run, stays as it was for this dataset.

    Raises
    ------
    UserError
        Where there is no such file, it is no result of `run-study`, or it is damaged: one line.
    """
    opened = _open(path)[0]
    # without axes of one value, which would leave no room for the words where the dataset is printed
    kept = opened.assign_coords({ENDED: outcome_words(opened["outcome"]).squeeze(drop=True)})
    loops = [name for name in LOOPS if name in opened]
    asked = study_tables(opened.attrs).get("outputs", {}).get("loops")
    pairs = [pair for pair in opened["contact"].values.tolist() if isinstance(asked, list) and pair in asked]
    if loops and pairs:
        others = [name for name, array in kept.coords.items() if "contact" in array.dims and name != "contact"]
        own = kept[loops].drop_vars(others).sel(contact=pairs).rename(contact="loop_contact")
        own["loop_contact"].attrs["long_name"] = "index of a contact pair whose loops are kept, see outputs.loops"
        kept = kept.drop_vars(loops).assign(own.data_vars)
    kept.encoding = opened.encoding
    kept.set_close(opened.close)
    return kept


def open_known(path: str | Path) -> xr.Dataset:
    """What the report knows of a result file, with its texts cleaned, see `check_dataset`. Raises UserError."""
    return _open(path)[1]


def _open(path: str | Path) -> tuple[xr.Dataset, xr.Dataset]:
    source, path = str(path), Path(path)
    check_result_file(path, source)
    with reading_errors(source, every=True), warnings.catch_warnings(action="ignore"):
        # the same file as before, whatever its name looks like
        opened = xr.open_dataset(path.absolute(), engine="netcdf4", decode_times=False)
        try:
            return opened, check_dataset(opened, source)
        except BaseException:
            opened.close()
            raise


@contextmanager
def reading_errors(source: str, *, every: bool = False) -> Iterator[None]:
    """Turns errors of the libraries about a damaged file into UserError; every: all errors, of a block that reads."""
    try:
        yield
    except UserError:
        raise
    except Exception as error:
        if every or (isinstance(error, OSError | RuntimeError) and "NetCDF:" in str(error)):
            raise UserError(source, "the file", Verbatim("damaged"), _REMEDY) from error
        raise


def outcome_words(outcome: xr.DataArray) -> xr.DataArray:
    """How each point ended, as a word of the attribute `flag_meanings` of `outcome`."""
    numbers = np.atleast_1d(outcome.attrs.get("flag_values", ())).tolist()
    words = dict(zip(numbers, str(outcome.attrs.get("flag_meanings", "")).split(), strict=False))
    named = [words.get(number, f"outcome_{number}") for number in outcome.values.ravel().tolist()]
    values = np.array(named, dtype=np.str_).reshape(outcome.shape)
    attributes = {"units": "1", "long_name": "how the computation of the point ended, in a word"}
    return xr.DataArray(values, outcome.coords, outcome.dims, attrs=attributes)


def study_tables(attributes: Mapping[str, object], source: str = "") -> dict[str, dict[str, object]]:
    """The effective study of a file, by table; empty where it cannot be read."""
    try:
        tables = read_toml(str(attributes.get("study", "")).encode("utf-8", "replace"), source)
    except UserError:
        return {}
    return {name: table for name, table in tables.items() if isinstance(table, dict)}


def check_dataset(dataset: xr.Dataset, source: str) -> xr.Dataset:
    """Variables of a file that the report knows, their texts cleaned. Only coordinates, texts and the mesh are read.

    source: name of the file for the user. Raises UserError where a variable is missing, or has a wrong shape or type.
    """
    slow = "mission" if "mission" in dataset.dims else "cycle"
    lacking = [name for name in ("outcome", slow, "contact") if name not in dataset.variables]
    if lacking:
        raise UserError(source, "OUT.nc", None, f"holds no {' and no '.join(lacking)}; {_REMEDY}")
    axes = tuple(map(str, dataset["outcome"].dims))
    try:
        _check_sizes(dataset, axes, slow)
        known = _known_variables(dataset, axes, slow)
        for name, (dimensions, entry) in known.items():
            _check_variable(dataset.variables[name], name, dimensions, entry)
        checked = dataset.drop_vars([name for name in dataset.variables if name not in known]).copy()
        checked = checked.set_coords([name for name in known if name in COORDINATES or name.startswith(DRAWN)])
        texts = {name: _texts(dataset.variables[name], name) for name in known if dataset[name].dtype.kind in "OSU"}
        checked = checked.assign_coords({name: texts.pop(name) for name in list(texts) if name in checked.coords})
        checked = checked.assign(texts)
        _check_values(checked, axes, slow)
    except _WrongError as wrong:
        raise UserError(source, wrong.name, Verbatim(wrong.found), _REMEDY) from None
    checked.attrs = _cleaned(checked.attrs)
    for variable in checked.variables.values():
        variable.attrs = _cleaned({name: variable.attrs[name] for name in _ATTRIBUTES if name in variable.attrs})
    checked.set_close(dataset.close)
    study_tables(checked.attrs, source)
    return checked


def check_numbers(dataset: xr.Dataset, source: str) -> None:
    """Raises UserError where there are numbers that are too large to be drawn, but for variables of more than 16 MB."""
    for name, variable in dataset.variables.items():
        if variable.dtype.kind == "f" and variable.size * variable.dtype.itemsize <= _LARGEST_READ:
            sizes = np.abs(variable.values)
            may_be_infinite = str(name).endswith(_INFINITE)
            wrong = sizes[(sizes > _LARGEST_NUMBER) & (np.isfinite(sizes) | (not may_be_infinite))]
            if wrong.size:
                raise UserError(source, str(name), Verbatim(f"{wrong[0]:g}"), _REMEDY)


def _need(right: object, name: str, found: str) -> None:
    if not right:
        raise _WrongError(name, found)


def _check_sizes(dataset: xr.Dataset, axes: Sequence[str], slow: str) -> None:
    for name in axes:
        _need(name.isidentifier() and len(name) <= _LONGEST_NAME, "outcome", "axes with unusual names")
    sizes = {str(name): size for name, size in dataset.sizes.items()}
    for name in (*axes, slow, "contact"):
        _need(0 < sizes.get(name, 0) <= _MOST_NAMES, name, f"{sizes.get(name, 0)} values")
    n_points = math.prod(sizes[name] for name in axes)
    n_values = n_points * math.prod(sizes.get(name, 1) for name in (slow, "response", "block"))
    is_small = n_points <= _MOST_POINTS and n_values <= _MOST_VALUES
    _need(is_small, "outcome", f"{n_points} points, {sizes[slow]} counts of {slow}s")


def _known_variables(
    dataset: xr.Dataset, axes: Sequence[str], slow: str
) -> dict[str, tuple[tuple[str, ...], Variable | None]]:
    """Variables of a file that the report knows: their dimensions and what they are, None for the values of an axis."""
    with_axes = ASKED | KEPT | LOOPS | COUNTS | SCENE["exact"]
    if slow == "mission":
        with_axes = OF_MISSIONS | OF_A_MISSION
    elif "modal_amplitude" in axes:
        with_axes = OF_MODES | OF_A_MODE_POINT
    found: dict[str, tuple[tuple[str, ...], Variable | None]] = {}
    for name, variable in ((str(name), variable) for name, variable in dataset.variables.items()):
        # what is of the scene, or drawn, has those axes along which it differs
        along = tuple(axis for axis in axes if axis in variable.dims)
        if name in dataset.dims:
            found[name] = (name,), None
        elif name.startswith(DRAWN) or (name == "frequency" and "frequency_ratio" in axes):
            found[name] = (*along, *(each for each in ("contact",) if each in variable.dims)), _DRAWN_VALUES
            _need({SAMPLE, "frequency_ratio"} & set(along), name, f"dimensions {', '.join(map(str, variable.dims))}")
        elif name in with_axes:
            found[name] = (*axes, *with_axes[name].dimensions), with_axes[name]
        elif name in _OF_SCENE:
            found[name] = (*along, *_OF_SCENE[name].dimensions), _OF_SCENE[name]
    for name in axes:
        _need(name in found, name, "no values along the dimension of this name")
    return found


def _check_variable(variable: xr.Variable, name: str, dimensions: tuple[str, ...], entry: Variable | None) -> None:
    """Dimensions and type; entry None: of an axis, which has finite numbers or texts."""
    _need(variable.dims == dimensions, name, f"dimensions {', '.join(map(str, variable.dims))}")
    _need(not {"scale_factor", "add_offset"} & set(variable.encoding), name, "packed values")
    kind = variable.dtype.kind
    if entry is not None:
        right = "OSU" if entry.is_text else "iuf" if entry.dtype.startswith("float") else "iu"
        _need(kind in right, name, f"type {variable.dtype}")
    elif kind in "iuf":
        _need(name not in _WORDS, name, "numbers in place of words")
        _need(np.isfinite(variable.values).all(), name, "a value that is no finite number")
    elif name in COORDINATES and name not in _TEXTS:
        _need(all(map(_is_choice, variable.values.tolist())), name, "texts in place of numbers")
    if entry is _DRAWN_VALUES:
        # NaN of pairs that a scene does not have
        _need(variable.size <= _MOST_VALUES, name, f"shape {variable.shape}")
        right = (np.abs(variable.values) < _LARGEST_NUMBER) | (np.isnan(variable.values) & ("contact" in dimensions))
        _need(right.all(), name, "a value that is no finite number")


def _is_choice(text: object) -> bool:
    """Whether a text stands for a number: the values of an axis with numbers and "auto" are texts."""
    try:
        return text == "auto" or math.isfinite(float(str(text)))
    except ValueError:
        return False


def _check_values(kept: xr.Dataset, axes: Sequence[str], slow: str) -> None:
    """Tests the values that lead to other values: cycles or missions, pairs, flags and mesh."""
    # worn joints whose modes are sought stand in any order
    counts = np.sort(kept[slow].values) if slow in axes else kept[slow].values
    rising = counts.dtype.kind in "iuf" and counts[0] >= 0 and (np.diff(counts) > 0).all()
    _need(rising, slow, "no counts in ascending order")
    pairs = kept["contact"].values
    differ = pairs.dtype.kind in "iu" and len(set(pairs.tolist())) == pairs.size
    _need(differ, "contact", "no whole numbers that differ")
    flags = np.atleast_1d(kept["outcome"].attrs.get("flag_values", np.zeros(0, int)))
    _need(flags.dtype.kind in "iu", "outcome:flag_values", "no whole numbers")
    nodes = [kept[name].values for name in ("mesh_x", "mesh_y", "mesh_z") if name in kept]
    _need(all(np.isfinite(each).all() for each in nodes), "mesh_x", "no finite number, here or beside it")
    if "mesh_quad" in kept:
        quad, n_nodes = kept["mesh_quad"].values, min((each.size for each in nodes), default=0)
        _need(((quad >= 0) & (quad < n_nodes)).all(), "mesh_quad", "nodes that there are not")


def _texts(variable: xr.Variable, name: str) -> xr.Variable:
    _need(variable.size <= _MOST_NAMES, name, f"shape {variable.shape}")
    longest = _LONGEST_SENTENCE if name == "message" else _LONGEST_NAME
    texts = [_line(each, longest) for each in variable.values.flat]
    return xr.Variable(variable.dims, np.array(texts, dtype=np.str_).reshape(variable.shape), variable.attrs)


def _cleaned(attributes: Mapping[str, Any]) -> dict[str, Any]:
    return {name: value if name == "flag_values" else _clean(name, value) for name, value in attributes.items()}


def _clean(name: object, value: object) -> str:
    """Text of an attribute without control characters."""
    if name in ("study", "sentences"):
        return show_text(value.decode("utf-8", "backslashreplace") if isinstance(value, bytes) else str(value))
    longest = {"units": _LONGEST_NAME, "flag_meanings": 50 * _LONGEST_SENTENCE}.get(str(name), _LONGEST_SENTENCE)
    return _line(value, longest)


@functools.lru_cache(maxsize=4096)  # most messages are the same
def _line(value: object, longest: int) -> str:
    """Text in one line, without control characters. longest: number of characters."""
    text = value.decode("utf-8", "backslashreplace") if isinstance(value, bytes) else str(value)
    text = show_text(" ".join(text[: 2 * longest].split()))
    return text if len(text) <= longest else f"{text[: longest - 1]}…"
