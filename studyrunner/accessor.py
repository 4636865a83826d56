"""What a result file means beyond its variables: complex responses, flanks as grids, fretting loops, files joined.

Importing this module gives every `xarray.Dataset` read from a result file the accessor `fretwear`.
"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from solver.outcome import Outcome
from studyrunner.coordinates import OF_SCENE
from studyrunner.measured import MeasuredSection, read_measured
from studyrunner.result.opening import ENDED, kind_of, outcome_words
from studyrunner.result.pairs import find_grid
from studyrunner.statistics.identification import CONFIDENCE, identify
from studyrunner.statistics.study_statistics import worn_volume_statistics
from studyrunner.study.text import read_toml
from studyrunner.summary.answer import Summary, summary
from studyrunner.user_error import UserError

_SELECTED = ("cycle", "mission", "block", "contact", "response", "sector")
"""Dimensions behind the axes, in their order, that a selection may take off."""
_PAIRS = ("contact", "contact_x", "contact_y", "contact_z", "contact_surface")


def _require(dataset: xr.Dataset, *names: str) -> None:
    """Raises ValueError where a dataset lacks variables."""
    if missing := [name for name in names if name not in dataset]:
        remedy = "give a result of a study that asks for it by [outputs] variables"
        raise ValueError(f"The dataset holds no {' and no '.join(missing)}: {remedy}.")


def _widened(dataset: xr.Dataset, name: str, variables: Sequence[str]) -> xr.Dataset:
    """With a dimension again, of length 1, which a selection has taken off variables. Raises ValueError where its value
    is lost.
    """
    needed = [each for each in variables if each in dataset and name not in dataset[each].dims]
    if not needed or dataset.sizes.get(name, 1) > 1:
        return dataset
    if name not in dataset.coords:
        raise ValueError(f"The dataset has lost its {name}: select or squeeze it without drop=True.")
    value, about = [dataset[name].item()], dataset[name].attrs
    put = {each: dataset[each].drop_vars(name).expand_dims(name) for each in needed if each != name}
    return dataset.drop_vars([name, *put]).assign(put).assign_coords({name: (name, value, about)})


class FretwearAccessor:
    """`dataset.fretwear` of a result file, whole or a selection from it."""

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = dataset

    def response(self) -> xr.DataArray:
        """First harmonic of the response, complex, m: the response is Re(value * exp(1j omega t)).

        Dimensions of `response_amplitude`; NaN where a point failed. ValueError: the file holds no amplitude or phase.
        """
        _require(self._dataset, "response_amplitude", "response_phase")
        # a damaged file may hold anything
        with np.errstate(invalid="ignore"):
            response = self._dataset["response_amplitude"] * np.exp(1j * self._dataset["response_phase"])
        return response.rename("response").assign_attrs(units="m", long_name="first harmonic of the response")

    def summary(self) -> Summary:
        """What came out: where the joint wears most, how much, how deep, how well that is known, what failed.

        `print` shows it as the last lines of a run do, `.values` has the numbers. Selected and squeezed results have
        one, too. ValueError: no result of a study, or one that has lost the value of a selected dimension.
        """
        _require(self._dataset, "outcome")
        kind, whole = kind_of(self._dataset), self._dataset
        named = {**kind.variables, **OF_SCENE}
        for name in _SELECTED:
            whole = _widened(whole, name, [each for each, entry in named.items() if name in entry.dimensions])
        if not whole["outcome"].dims:
            whole = _widened(whole, kind.axes[0], list(kind.variables))
        _require(whole, "contact")
        order = dict.fromkeys((*whole["outcome"].dims, *_SELECTED))
        return summary(whole.transpose(*order, ..., missing_dims="ignore"))

    @property
    def surfaces(self) -> tuple[str, ...]:
        """Labels of the surfaces of the joint, in the order in which they first appear."""
        _require(self._dataset, "contact_surface")
        return tuple(dict.fromkeys(str(label) for label in self._dataset["contact_surface"].values))

    def worn_volume_statistics(
        self,
        quantiles: Sequence[float] = (0.05, 0.5, 0.95),
        confidence: float = 0.95,
        exceed: Sequence[float] | None = None,
        depth: Sequence[float] | None = None,
        limits: Mapping[str, float] | None = None,
    ) -> xr.Dataset:
        """`studyrunner.statistics.study_statistics.worn_volume_statistics` of this dataset. ValueError: no samples."""
        return worn_volume_statistics(self._dataset, quantiles, confidence, exceed, depth, limits)

    def identify(self, measured: Mapping[str, object] | None = None, confidence: float = CONFIDENCE) -> xr.Dataset:
        """`studyrunner.statistics.identification.identify` of this dataset: inputs by what was measured. measured: as
        the table [measured] of a study, with numbers or paths of files. ValueError: as there, or a number is wrong.
        """
        section = None
        if measured is not None:
            section = MeasuredSection.model_validate(read_measured(measured, "identify", Path()), strict=False)
        return identify(self._dataset, section, confidence)

    def flank(self, name: str, surface: str) -> xr.DataArray:
        """Variable `name` of the pairs of one surface, on the grid in which they lie.

        Dimensions (..., across, along), coordinates in m, from 0. `along`: the straight direction of the flank, of
        two the longer, as the axial one of a dovetail; its largest component is positive. `across`: from line to line,
        beginning with the line farther from the origin, so that a flank of a disk is followed inwards. `contact`,
        (across, along): the pairs. ValueError: the variable is none of pairs, or the pairs do not lie on a grid.
        """
        _require(self._dataset, name, *_PAIRS)
        if "contact" not in self._dataset[name].dims:
            dimensions = ", ".join(map(str, self._dataset[name].dims))
            raise ValueError(f"{name} does not belong to contact pairs, but to {dimensions}.")
        members = np.flatnonzero(self._dataset["contact_surface"].values == surface)
        if members.size == 0:
            raise ValueError(f"There is no surface {surface!r} in the result; it has {', '.join(self.surfaces)}.")
        position = np.stack([self._dataset[f"contact_{axis}"].values[members] for axis in "xyz"], axis=1)
        try:
            grid = find_grid(position)
        except ValueError as error:
            raise ValueError(f"Surface {surface!r} is not drawn as a map: {error}") from None
        pairs = xr.DataArray(members[grid.pair], dims=("across", "along"))
        values = self._dataset[name].isel(contact=pairs).drop_vars("contact_surface")
        values = values.assign_coords(across=grid.across, along=grid.along, contact_surface=surface)
        values["across"].attrs = {"units": "m", "long_name": "distance down the flank"}
        values["along"].attrs = {"units": "m", "long_name": "distance along the flank"}
        return values.transpose(..., "across", "along")

    def outcomes(self) -> xr.DataArray:
        """How each point ended, in a word; the sentence of each word is in `outcome.sentences`."""
        _require(self._dataset, "outcome")
        return outcome_words(self._dataset["outcome"])

    def loop(self, contact: int) -> xr.Dataset:
        """Relative displacement and contact force of a pair through a period, closed: the first phase again at 2 pi.

        `displacement`, m, and `force`, N, with dimensions (..., cycle, phase, component). The displacement of the
        component "normal" is positive when the pair closes, its force in compression. ValueError: the file does not
        hold the loop.
        """
        names = {"loop_displacement": "displacement", "loop_force": "force"}
        loops = self._dataset[[name for name in names if name in self._dataset]]
        axis = "loop_contact" if "loop_contact" in loops.dims else "contact"
        if axis in loops.dims and contact in loops[axis].values:
            loop = loops.sel({axis: contact}).rename(names)
            if loop["force"].notnull().any():
                first = loop.isel(phase=[0]).assign_coords(phase=loop["phase"][:1] + 2.0 * math.pi)
                closed = xr.concat(
                    [loop, first], dim="phase", data_vars="minimal", coords="minimal", compat="override", join="outer"
                )
                closed["phase"].attrs = loop["phase"].attrs
                return closed.transpose(..., "phase", "component")
        ask = f"ask for it by [outputs] loops = [{contact}], unless its points failed"
        raise ValueError(f"The result holds no loop of contact pair {contact}; {ask}.")


# Not registered, as xarray keeps a registered accessor in its dataset: that cycle leaves closing the file to the
# garbage collector, which may come while the netCDF library opens another one: it then crashes, or finds damage.
xr.Dataset.fretwear = property(FretwearAccessor)  # type: ignore[attr-defined]


def join_results(datasets: Sequence[xr.Dataset], dim: str | None = None) -> xr.Dataset:
    """One result of several: the axes hold the values of all of them. A point in several is taken whole from the last.

    A point in none of them is NaN, its whole numbers 0 and its `outcome` not_computed. Attributes are kept that all
    agree on. dim: key of the study that differs between the results and is no axis, as "friction_coefficient" or
    "scene.friction_coefficient"; it becomes the first axis. ValueError: the results have different axes or pairs, are
    of different scenes and no `dim` is given, or lack the key.
    """
    if not datasets:
        raise ValueError("There are no results to join.")
    for dataset in datasets:
        _require(dataset, "outcome", *_PAIRS)
    in_words = all(ENDED in dataset.coords for dataset in datasets)
    datasets = [dataset.drop_vars(ENDED, errors="ignore") for dataset in datasets]
    if dim is not None:
        datasets = [_with_axis(dataset, dim) for dataset in datasets]
    elif len({dataset.attrs.get("scene_sha256") for dataset in datasets}) > 1:
        raise ValueError("The results are of different scenes: name the key in which they differ by dim=.")
    first, axes = datasets[0], datasets[0]["outcome"].dims
    for other in datasets:
        if other["outcome"].dims != axes:
            raise ValueError(f"The results have different axes: {axes} and {other['outcome'].dims}.")
        n_outputs = [one.sizes["cycle"] for one in (first, other) if "cycle_count" in one]
        if n_outputs and n_outputs != 2 * [first.sizes["cycle"]]:
            raise ValueError("A result with slow_time.cycles = inf joins only those, and with as many outputs.")
        for each in _PAIRS:
            if not other[each].variable.equals(first[each].variable):  # type: ignore[no-untyped-call]
                raise ValueError(f"The results have different contact pairs: see {each}.")
    models = {name: array for one in datasets for name, array in one.data_vars.items()}
    missing: dict[str, Any] = {"f": math.nan, "O": "", "U": ""}
    gaps = {name: missing.get(array.dtype.kind, 0) for name, array in models.items()}
    gaps["outcome"] = int(Outcome.NOT_COMPUTED)
    texts = [d for d in axes if first[d].dtype.kind in "OU"]
    as_they_come = {d: list(dict.fromkeys(text for one in datasets for text in one[d].values.tolist())) for d in texts}
    parts = [part.sel(as_they_come) for part in xr.align(*datasets, join="outer", fill_value=gaps)]
    joined = parts[0].drop_vars(models, errors="ignore")
    for name, model in models.items():
        # one without the axes, as a mesh, is the same in all results
        if set(axes) <= set(model.dims):
            taken = blank = xr.full_like(next(part[name] for part in parts if name in part), gaps[name])
            for part in parts:
                taken = part.get(name, blank).where(part["outcome"] != Outcome.NOT_COMPUTED, taken)
            model = taken.transpose(*model.dims).assign_attrs(model.attrs)
        joined = joined.assign({name: model})
    common = {key: text for key, text in first.attrs.items() if all(one.attrs.get(key) == text for one in datasets)}
    history = [f"joined of {len(datasets)} results", *dict.fromkeys(str(one.attrs.get("history")) for one in datasets)]
    joined.attrs = {**common, "history": "\n".join(history)}
    return joined.assign_coords({ENDED: outcome_words(joined["outcome"])}) if in_words else joined


def _with_axis(dataset: xr.Dataset, key: str) -> xr.Dataset:
    """The result with a key of its study as the first axis of all but the mesh, which is no result."""
    try:
        study = read_toml(str(dataset.attrs["study"]).encode(), f"the study of {dataset.attrs.get('title')!r}")
    except UserError as error:
        raise ValueError(str(error)) from None
    *table, name = key.split(".")
    tables = {title: keys for title, keys in study.items() if isinstance(keys, dict)}
    values = [keys[name] for title, keys in tables.items() if name in keys and title in (table or study)]
    if len(values) != 1 or name in dataset.dims:
        raise ValueError(f"{key} is not one value in the study of {dataset.attrs.get('title')!r}.")
    expanded = [each for each, array in dataset.data_vars.items() if not str(each).startswith("mesh_")]
    axis = xr.Variable(name, np.array(values), {"long_name": name.replace("_", " ")})
    return dataset.assign({each: dataset[each].expand_dims({name: 1}) for each in expanded}).assign_coords({name: axis})
