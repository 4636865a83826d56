"""Opens result files: the one way to read a result, after a check of its sizes, dimensions and types.

Texts of the file stay texts: without control characters and line breaks, and as long as a sentence at most.

By hand: `xarray-schema` has no limits of sizes, and leaves texts as they are.
"""

import functools
import math
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from solver.outcome import Outcome
from studyrunner.coordinates import COORDINATES, OF_SCENE, POINT, SAMPLE, SCENE
from studyrunner.kinds.kind import Kind
from studyrunner.kinds.table import kind_of_file
from studyrunner.kinds.wear.kind import CERTIFICATE, LOOPS
from studyrunner.statistics.samples import DRAWN
from studyrunner.study.text import check_result_file, read_toml
from studyrunner.user_error import UserError, Verbatim, show_text
from studyrunner.values import Wrong
from studyrunner.variables import Variable, in_metres

KIND = "kind"
"""Attribute of a result: name of its kind of study."""

ENDED = "ended"
"""Coordinate of an opened result: `outcome` in words."""

_MOST_POINTS = 10**6
_MOST_VALUES = 2**27  # of a variable without contact pairs, which may be read as a whole
_MOST_NAMES = 2**20  # values along any dimension
_LARGEST_READ = 2**24  # bytes
_LARGEST_NUMBER = 1e30
_INFINITE = (
    "_error",
    "error_estimate",
    "step_limit",
    "cycle_count",
    "last_cycle",
    "sweep_rate",
    "pair_stiffness",
    *CERTIFICATE,
)
"""Ends of the names of variables that may be infinite: errors not known, after any cycle, rates without damping, rigid
contact."""
_LONGEST = 400  # characters of a text
_LONG = ("study", "flag_meanings")
_OF_VARIABLES = ("units", "long_name", "flag_meanings", "flag_values")  # attributes for the report
_REMEDY = "give a result file of run-study that is whole"

_WORDS = ("scheme", "sweep")
_TEXTS = (*_WORDS, "response", "component", "block")
_DRAWN_VALUES = Variable((), "1", "what the samples draw of an input")


def open_result(path: str | Path) -> xr.Dataset:
    """Open a result file after a check that it is a result of `run-study`: sizes, dimensions and types.

    The dataset is that of `xarray.open_dataset(path)`, read when it is needed. Two things are added: the coordinate
    `ended`, which is `outcome` in words; and loops have the dimension `loop_contact`, the pairs that have loops, in
    place of `contact`. The file stays open until the dataset is closed: use it in a `with` statement, or call its
    `load` and `close`. A file that is replaced meanwhile, by another run, stays as it was for this dataset.

    Raises UserError where there is no such file, it is no result of `run-study`, or it is damaged: one line.
    """
    opened = _open(path)[0]
    # without axes of one value, which would leave no room for the words where the dataset is printed
    result = opened.assign_coords({ENDED: outcome_words(opened["outcome"]).squeeze(drop=True)})
    names, pairs = [name for name in LOOPS if name in opened], pairs_with_loops(opened)
    if names and pairs:
        others = [name for name, array in result.coords.items() if "contact" in array.dims and name != "contact"]
        loops = result[names].drop_vars(others).sel(contact=pairs).rename(contact="loop_contact")
        loops["loop_contact"].attrs["long_name"] = "index of a contact pair whose loops are stored, see outputs.loops"
        result = result.drop_vars(names).assign(loops.data_vars)
    result.encoding = opened.encoding
    result.set_close(opened.close)
    return result


def pairs_with_loops(dataset: xr.Dataset) -> list[int]:
    """Contact pairs of a file whose loops its study has asked for."""
    listed = study_tables(dataset.attrs).get("outputs", {}).get("loops")
    return [pair for pair in dataset["contact"].values.tolist() if isinstance(listed, list) and pair in listed]


def open_known(path: str | Path) -> xr.Dataset:
    """What the report knows of a result file, with its texts cleaned, see `check_dataset`.

    Raises UserError, also where numbers are too large to be drawn, but for variables of more than 16 MB.
    """
    known, source = _open(path)[1], str(path)
    with reading_errors(source, every=True):
        for name, variable in known.variables.items():
            if variable.dtype.kind == "f" and variable.size * variable.dtype.itemsize <= _LARGEST_READ:
                sizes = np.abs(variable.values)
                may_be_infinite = str(name).endswith(_INFINITE)
                wrong = sizes[(sizes > _LARGEST_NUMBER) & (np.isfinite(sizes) | (not may_be_infinite))]
                if wrong.size:
                    raise UserError(source, str(name), Verbatim(f"{wrong.max():g}"), _REMEDY)
    return known


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


def as_history(dataset: xr.Dataset) -> tuple[xr.Dataset, xr.Dataset | None]:
    """The dataset with missions as cycles and without what belongs to single blocks, and these variables or None.

    Responses with a unit of their own in their name, as root stress [MPa], are left out: the others share a scale.
    """
    history, blocks = dataset, None
    if "response" in dataset.coords:
        kept = in_metres(dataset["response"].values)
        history = history if len(kept) == dataset["response"].size else history.isel(response=kept)
    kind = kind_of(dataset)
    if "block" in dataset.dims:
        names = map(str, history.variables)
        renamed = history.rename({name: name.replace(kind.counted, "cycle") for name in names if kind.counted in name})
        of_blocks = [name for name, variable in renamed.variables.items() if "block" in variable.dims]
        history, blocks = renamed.drop_vars(of_blocks).assign_attrs({KIND: kind.name}), renamed[of_blocks]
    if history is not dataset:
        # a dataset of another loses the file to be closed
        history.set_close(dataset.close)
    return history, blocks


@contextmanager
def reading_errors(source: str, *, every: bool = False) -> Iterator[None]:
    """Turns errors of the libraries about a damaged file into UserError; every: all errors, of a block that reads."""
    try:
        yield
    except Wrong as error:
        raise UserError(source, error.key, error.value, error.remedy) from None
    except Exception as error:
        of_library = isinstance(error, OSError | RuntimeError) and "NetCDF:" in str(error)
        if (every or of_library) and not isinstance(error, UserError):
            raise UserError(source, "the file", Verbatim("damaged"), _REMEDY) from error
        raise


def describe_outcome(number: int) -> tuple[str, str, str]:
    """Word and sentence of an outcome, and what has happened; the number, where it is one of a later version."""
    if number not in list(Outcome):
        return f"outcome_{number}", f"outcome {number}", f"outcome {number}"
    outcome = Outcome(number)
    return outcome.meaning, outcome.sentence, outcome.happened


def outcome_words(outcome: xr.DataArray) -> xr.DataArray:
    """How each point ended, in a word."""
    words = [describe_outcome(number)[0] for number in outcome.values.ravel().tolist()]
    values = np.array(words, dtype=np.str_).reshape(outcome.shape)
    attributes = {"units": "1", "long_name": "how the computation of the point ended, in a word"}
    return xr.DataArray(values, outcome.coords, outcome.dims, attrs=attributes)


def kind_of(dataset: xr.Dataset) -> Kind:
    """The kind of study of an opened result. Raises Wrong where it is one of a later version."""
    given = dataset.attrs.get(KIND)
    return kind_of_file(None if given is None else _decoded(given), [str(name) for name in dataset.dims])


def study_tables(attributes: Mapping[str, object]) -> dict[str, dict[str, object]]:
    """The effective study of a file, by table; empty where it cannot be read."""
    with suppress(UserError):
        tables = read_toml(str(attributes.get("study", "")).encode("utf-8", "replace"), "")
        return {name: table for name, table in tables.items() if isinstance(table, dict)}
    return {}


# --- the check of a file ---


def check_dataset(dataset: xr.Dataset, source: str) -> xr.Dataset:
    """Variables of a file that the report knows, their texts cleaned. Only coordinates, texts and the mesh are read.

    source: name of the file for the user. Raises UserError where a variable is missing, or has a wrong shape or type.
    """
    with reading_errors(source):
        known = _known_variables(dataset)
        checked = dataset.drop_vars([name for name in dataset.variables if name not in known]).copy()
        for name, (dimensions, entry) in known.items():
            _check_variable(name, dataset.variables[name], dimensions, entry)
            if name in COORDINATES or name.startswith(DRAWN) or (dimensions, entry) == ((POINT,), None):
                checked = checked.set_coords(name)
            variable = checked.variables[name]
            if variable.dtype.kind in "OSU":
                _need(variable.size <= _MOST_NAMES, name, f"shape {variable.shape}")
                texts = np.array([_line(each) for each in variable.values.flat], np.str_).reshape(variable.shape)
                put = checked.assign_coords if name in checked.coords else checked.assign
                checked = put({name: xr.Variable(variable.dims, texts, variable.attrs)})
        _check_values(checked)
    checked.attrs = _attributes(checked.attrs)
    for variable in checked.variables.values():
        variable.attrs = _attributes({name: variable.attrs[name] for name in _OF_VARIABLES if name in variable.attrs})
    checked.set_close(dataset.close)
    return checked


def _need(right: object, name: str, wrong: str) -> None:
    if not right:
        raise Wrong(name, Verbatim(wrong), _REMEDY)


def _known_variables(dataset: xr.Dataset) -> dict[str, tuple[tuple[str, ...], Variable | None]]:
    """Of each variable that the report knows its dimensions and what it is, None for the values of an axis."""
    kind, sizes = kind_of(dataset), {str(name): size for name, size in dataset.sizes.items()}
    slow = kind.wear_states
    if lacking := [name for name in ("outcome", slow, "contact") if name not in dataset.variables]:
        raise Wrong("OUT.nc", None, f"holds no {' and no '.join(lacking)}; {_REMEDY}")
    axes = tuple(map(str, dataset["outcome"].dims))
    for name in (*axes, slow, "contact"):
        _need(0 < sizes.get(name, 0) <= _MOST_NAMES, name, f"{sizes.get(name, 0)} values")
        _need(name.isidentifier() and name in dataset.variables, name, "no values along the dimension of this name")
    n_points = math.prod(sizes[name] for name in axes)
    n_values = n_points * math.prod(sizes.get(name, 1) for name in (slow, "response", "block"))
    is_small = n_points <= _MOST_POINTS and n_values <= _MOST_VALUES
    _need(is_small, "outcome", f"{n_points} points, {sizes[slow]} counts of {slow}s")
    with_axes = {**kind.variables, **SCENE["exact"]}
    known: dict[str, tuple[tuple[str, ...], Variable | None]] = {}
    for name, variable in ((str(name), variable) for name, variable in dataset.variables.items()):
        # what is of the scene, or drawn, has those axes along which it differs
        along = tuple(axis for axis in axes if axis in variable.dims)
        if name in dataset.dims:
            known[name] = (name,), None
        elif name.startswith(DRAWN) or (name == "frequency" and along):
            known[name] = (*along, *(each for each in ("contact", "sector") if each in variable.dims)), _DRAWN_VALUES
            is_along = {SAMPLE, "frequency_ratio", POINT} & set(along)
            _need(is_along, name, f"dimensions {', '.join(map(str, variable.dims))}")
        elif name in with_axes:
            known[name] = (*axes, *with_axes[name].dimensions), with_axes[name]
        elif name in OF_SCENE:
            known[name] = (*along, *OF_SCENE[name].dimensions), OF_SCENE[name]
        elif variable.dims == (POINT,):
            known[name] = (POINT,), None
    return known


def _check_variable(name: str, variable: xr.Variable, dimensions: tuple[str, ...], entry: Variable | None) -> None:
    """Dimensions and type; entry None: of an axis, which has finite numbers or texts."""
    _need(variable.dims == dimensions, name, f"dimensions {', '.join(map(str, variable.dims))}")
    kind = variable.dtype.kind
    if entry is not None:
        right = "OSU" if entry.is_text else "iuf" if entry.dtype.startswith("float") else "iu"
        _need(kind in right, name, f"type {variable.dtype}")
    elif kind in "iuf":
        _need(name not in _WORDS, name, "numbers in place of words")
        _need(np.isfinite(variable.values).all(), name, "a value that is no finite number")
    elif name in COORDINATES and name not in _TEXTS:
        # the values of an axis with numbers and "auto" are texts
        with suppress(ValueError):
            if np.isfinite([float(each) for each in variable.values if each != "auto"]).all():
                return
        _need(False, name, "texts in place of numbers")
    if entry is _DRAWN_VALUES:
        # NaN of pairs that a scene does not have
        _need(variable.size <= _MOST_VALUES, name, f"shape {variable.shape}")
        right = (np.abs(variable.values) < _LARGEST_NUMBER) | (np.isnan(variable.values) & ("contact" in dimensions))
        _need(right.all(), name, "a value that is no finite number")


def _check_values(dataset: xr.Dataset) -> None:
    """Tests the values that lead to other values: cycles or missions, pairs and mesh."""
    slow = kind_of(dataset).wear_states
    # worn joints whose modes are sought stand in any order
    counts = np.sort(dataset[slow].values) if slow in dataset["outcome"].dims else dataset[slow].values
    rising = counts.dtype.kind in "iuf" and counts[0] >= 0 and (np.diff(counts) > 0).all()
    _need(rising, slow, "no counts in ascending order")
    pairs = dataset["contact"].values
    differ = pairs.dtype.kind in "iu" and len(set(pairs.tolist())) == pairs.size
    _need(differ, "contact", "no whole numbers that differ")
    nodes = [dataset[name].values for name in ("mesh_x", "mesh_y", "mesh_z") if name in dataset]
    _need(all(np.isfinite(each).all() for each in nodes), "mesh_x", "no finite number, here or beside it")
    if "mesh_quad" in dataset:
        quad, n_nodes = dataset["mesh_quad"].values, min((each.size for each in nodes), default=0)
        _need(((quad >= 0) & (quad < n_nodes)).all(), "mesh_quad", "nodes that there are not")


def _attributes(attributes: Mapping[str, Any]) -> dict[str, Any]:
    """Attributes without control characters, in one line but for texts of several."""
    cleaned = {name: value if name == "flag_values" else _line(value) for name, value in attributes.items()}
    return cleaned | {name: show_text(_decoded(attributes[name])) for name in _LONG if name in attributes}


@functools.lru_cache(maxsize=4096)  # most messages are the same
def _line(value: object) -> str:
    """Text in one line, without control characters, not longer than a sentence."""
    text = show_text(" ".join(_decoded(value)[: 2 * _LONGEST].split()))
    return text if len(text) <= _LONGEST else f"{text[: _LONGEST - 1]}…"


def _decoded(value: object) -> str:
    return value.decode("utf-8", "backslashreplace") if isinstance(value, bytes) else str(value)
