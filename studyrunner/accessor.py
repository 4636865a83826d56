"""What a result file means beyond its variables: complex responses, flanks as grids, fretting loops, files joined.

Importing this module gives every `xarray.Dataset` read from a result file the accessor `fretwear`.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from studyrunner.result.grid import find_grid
from studyrunner.statistics.study_statistics import worn_volume_statistics
from studyrunner.study.toml_text import read_toml
from studyrunner.summary.answer import Summary, summary
from studyrunner.user_error import UserError

_SAME = 1e-9  # relative: two values of an axis that differ by less are one
_NOT_COMPUTED = 13  # `Outcome.NOT_COMPUTED` of the solver, which results are read without
_PAIRS = ("contact", "contact_x", "contact_y", "contact_z", "contact_surface")


@xr.register_dataset_accessor("fretwear")  # type: ignore[no-untyped-call]
class FretwearAccessor:
    """`dataset.fretwear` of a result file, whole or a selection from it."""

    def __init__(self, dataset: xr.Dataset) -> None:
        self._dataset = dataset

    def response(self) -> xr.DataArray:
        """First harmonic of the response, complex, m: the response is Re(value * exp(1j omega t)).

        Dimensions of `response_amplitude`; NaN where a point failed. KeyError: the file holds no amplitude or no phase.
        """
        amplitude, phase = self._dataset["response_amplitude"], self._dataset["response_phase"]
        # a damaged file may hold anything
        with np.errstate(invalid="ignore"):
            response = (amplitude * np.exp(1j * phase)).rename("response")
        return response.assign_attrs(units="m", long_name="first harmonic of the response")

    def summary(self) -> Summary:
        """What came out: where the joint wears most, how much, how deep, how well that is known, what failed.

        `print` shows it as the last lines of a run do.
        """
        return summary(self._dataset)

    @property
    def surfaces(self) -> tuple[str, ...]:
        """Labels of the surfaces of the joint, in the order in which they first appear."""
        return tuple(dict.fromkeys(str(label) for label in self._dataset["contact_surface"].values))

    def worn_volume_statistics(
        self,
        quantiles: Sequence[float] = (0.05, 0.5, 0.95),
        confidence: float = 0.95,
        exceed: Sequence[float] | None = None,
        depth: Sequence[float] | None = None,
    ) -> xr.Dataset:
        """What the samples of a study with [scatter] say of worn volume and depth.

        As `studyrunner.statistics.study_statistics.worn_volume_statistics` of this dataset. ValueError: it has none.
        """
        return worn_volume_statistics(self._dataset, quantiles, confidence, exceed, depth)

    def flank(self, name: str, surface: str) -> xr.DataArray:
        """Variable `name` of the pairs of one surface, on the grid in which they lie.

        Dimensions (..., across, along), coordinates in m, from 0. `along`: the straight direction of the flank, of
        two the longer, as the axial one of a dovetail; its largest component is positive. `across`: from line to line,
        beginning with the line farther from the origin, so that a flank of a disk is followed inwards. `contact`,
        (across, along): the pairs. ValueError: the variable is none of pairs, or the pairs do not lie on a grid.
        """
        if "contact" not in self._dataset[name].dims:
            raise ValueError(
                f"{name} does not belong to contact pairs, but to {', '.join(map(str, self._dataset[name].dims))}."
            )
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

    def loop(self, contact: int) -> xr.Dataset:
        """Relative displacement and contact force of a pair through a period, closed: the first phase again at 2 pi.

        `displacement`, m, and `force`, N, with dimensions (..., cycle, phase, component). The displacement of the
        component "normal" is positive when the pair closes, its force in compression. ValueError: the file does not
        hold the loop.
        """
        ask = f"ask for it by [outputs] loops = [{contact}]"
        if not {"loop_displacement", "loop_force"} <= set(self._dataset.data_vars):
            raise ValueError(f"The result holds no loops; {ask}.")
        if contact not in self._dataset["contact"].values:
            raise ValueError(f"There is no contact pair {contact} in the result.")
        names = {"loop_displacement": "displacement", "loop_force": "force"}
        loop = self._dataset[list(names)].sel(contact=contact).rename(names)
        if not loop["force"].notnull().any():
            raise ValueError(f"The result holds no loop of contact pair {contact}; {ask}, unless its points failed.")
        first = loop.isel(phase=[0]).assign_coords(phase=loop["phase"][:1] + 2.0 * math.pi)
        closed = xr.concat(
            [loop, first], dim="phase", data_vars="minimal", coords="minimal", compat="override", join="outer"
        )
        closed["phase"].attrs = loop["phase"].attrs
        return closed.transpose(..., "phase", "component")


def join_results(datasets: Sequence[xr.Dataset], dim: str | None = None) -> xr.Dataset:
    """One result of several: the axes hold the values of all of them. A point in several is taken whole from the last.

    A point in none of them is NaN, its whole numbers 0 and its `outcome` not_computed. Attributes are kept that all
    agree on.

    Parameters
    ----------
    datasets
        Results, read from files of `run-study`.
    dim
        Name of a key of the study that differs between them and is no axis, e.g. "friction_coefficient" or
        "scene.friction_coefficient"; it becomes the first axis.

    Raises
    ------
    ValueError
        Where the results have different axes or pairs, are of different scenes and no `dim` is given, or lack the key.
    """
    if not datasets:
        raise ValueError("There are no results to join.")
    if dim is not None:
        datasets = [_with_axis(dataset, dim) for dataset in datasets]
    elif len({dataset.attrs.get("scene_sha256") for dataset in datasets}) > 1:
        raise ValueError("The results are of different scenes: name the key in which they differ by dim=.")
    first, axes = datasets[0], datasets[0]["outcome"].dims
    for other in datasets:
        if other["outcome"].dims != axes:
            raise ValueError(f"The results have different axes: {axes} and {other['outcome'].dims}.")
        own = "cycle_count" in first
        if ("cycle_count" in other) != own or (own and other.sizes["cycle"] != first.sizes["cycle"]):
            raise ValueError("A result with slow_time.cycles = inf joins only those, and with as many outputs.")
        for each in _PAIRS:
            if not np.array_equal(other[each].values, first[each].values, equal_nan=first[each].dtype.kind == "f"):
                raise ValueError(f"The results have different contact pairs: see {each}.")
    # Of each variable the last that is there; those without an axis, as a mesh, are the same in all results.
    last = {name: one.variables[name] for one in datasets for name in one.data_vars}
    dims = dict.fromkeys(d for variable in last.values() if set(axes) & set(variable.dims) for d in variable.dims)
    known = {d: _union([one[d].values for one in datasets if d in one.dims]) for d in dims}
    joined = {name: variable.copy() for name, variable in last.items()}
    for name, variable in last.items():
        if set(axes) & set(variable.dims):
            joined[name] = _join_variable(name, variable, datasets, {d: known[d] for d in variable.dims}, axes)
    coordinates = {name: array.variable for one in reversed(datasets) for name, array in one.coords.items()}
    coordinates |= {d: xr.Variable(d, values, coordinates[d].attrs) for d, values in known.items()}
    common = {key: text for key, text in first.attrs.items() if all(one.attrs.get(key) == text for one in datasets)}
    history = [f"joined of {len(datasets)} results", *dict.fromkeys(str(one.attrs.get("history")) for one in datasets)]
    return xr.Dataset(joined, coordinates, {**common, "history": "\n".join(history)})


def _join_variable(
    name: Hashable,
    model: xr.Variable,
    datasets: Sequence[xr.Dataset],
    known: Mapping[Hashable, NDArray[Any]],
    axes: Sequence[Hashable],
) -> xr.Variable:
    """A variable of all results, over the known values of its dimensions. model: one of them."""
    fill = math.nan if model.dtype.kind == "f" else _NOT_COMPUTED if name == "outcome" else 0
    target = np.full([len(values) for values in known.values()], fill, dtype=model.dtype)
    for one in datasets:
        place = {d: _places(one[d].values, values) for d, values in known.items() if d in one.dims}
        # Nothing of an earlier result stays in a point that a later one holds.
        points = [place[d] if d in axes else np.arange(len(values)) for d, values in known.items()]
        target[np.ix_(*points)] = fill
        if name in one:
            target[np.ix_(*(place[d] for d in known))] = one[name].transpose(*known).values
    attributes = dict(model.attrs)
    if name == "outcome" and _NOT_COMPUTED in target and _NOT_COMPUTED not in attributes["flag_values"]:
        attributes["flag_values"] = np.append(attributes["flag_values"], target.dtype.type(_NOT_COMPUTED))
        attributes["flag_meanings"] += " not_computed"
        if "sentences" in attributes:
            attributes["sentences"] += "\nThe point is in none of the results that were joined."
    return xr.Variable(tuple(known), target, attributes)


def _with_axis(dataset: xr.Dataset, key: str) -> xr.Dataset:
    """The result with a key of its study as the first axis of all but the mesh, which is no result."""
    try:
        study = read_toml(str(dataset.attrs["study"]).encode(), f"the study of {dataset.attrs.get('title')!r}")
    except UserError as error:
        raise ValueError(str(error)) from None
    *table, name = key.split(".")
    tables = {title: keys for title, keys in study.items() if isinstance(keys, dict)}
    found = [keys[name] for title, keys in tables.items() if name in keys and title in (table or study)]
    if len(found) != 1 or name in dataset.dims:
        raise ValueError(f"{key} is not one value in the study of {dataset.attrs.get('title')!r}.")
    expanded = [each for each, array in dataset.data_vars.items() if not str(each).startswith("mesh_")]
    axis = xr.Variable(name, np.array(found), {"long_name": name.replace("_", " ")})
    return dataset.assign({each: dataset[each].expand_dims({name: 1}) for each in expanded}).assign_coords({name: axis})


def _union(values: Sequence[NDArray[Any]]) -> NDArray[Any]:
    """All values of an axis: numbers in order, texts as they come."""
    joined = np.concatenate(values)
    if joined.dtype.kind not in "iuf":
        return np.array(list(dict.fromkeys(joined.tolist())))
    joined = np.sort(joined)
    new: NDArray[np.bool_] = np.diff(joined, prepend=-math.inf) > _SAME * np.abs(joined)
    return joined[new]


def _places(values: NDArray[Any], known: NDArray[Any]) -> NDArray[np.intp]:
    """Where values of an axis are among all of them."""
    if known.dtype.kind in "iuf":
        nearest: NDArray[np.intp] = np.abs(known - values[:, None]).argmin(axis=1)
        return nearest
    return np.array([known.tolist().index(value) for value in values.tolist()], dtype=np.intp)
