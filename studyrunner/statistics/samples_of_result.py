"""The samples that a result holds: worn volumes and depths with their bounds and errors, and the drawn inputs."""

from __future__ import annotations

import tomllib
from collections.abc import Hashable

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from studyrunner.scatter.section import ScatterSection
from studyrunner.statistics.bands import Array, SampleValues

SAMPLE, CYCLE = "sample", "cycle"
_DRAWN = "sample_"
_SENSITIVE = "sensitive"


def counted(dataset: xr.Dataset) -> xr.Dataset:
    """The result at the counts that all points share: only the last one where each point has counts of its own."""
    return dataset.isel({CYCLE: [-1]}) if "cycle_count" in dataset else dataset


def volume_samples(dataset: xr.Dataset) -> tuple[SampleValues, dict[Hashable, int]]:
    """Worn volumes, m3, with the sample last, and names and lengths of the dimensions before it.

    A volume that was not computed lies above the last one that was, as worn volume never falls, without upper bound.
    A `sensitive` one lies within its error. An error that was never estimated is infinite.
    """
    return _samples(dataset, dataset["worn_volume"], dataset.get("worn_volume_error"), relative=True)


def depth_samples(dataset: xr.Dataset) -> tuple[SampleValues, dict[Hashable, int]] | None:
    """Depths of the deepest pair, m, as `volume_samples`; None where the result holds no depths.

    Their error is the largest one of any pair.
    """
    if "wear_depth" in dataset and CYCLE in dataset["wear_depth"].dims:
        depth, error = dataset["wear_depth"].max("contact"), dataset.get("wear_depth_error")
        return _samples(dataset, depth, None if error is None else error.max("contact"), relative=False)
    if "wear_depth_max" in dataset:
        return _samples(dataset, dataset["wear_depth_max"], dataset.get("wear_depth_max_error"), relative=False)
    return None


def inputs_of(dataset: xr.Dataset) -> dict[str, Array]:
    """Drawn values (n,) of each input, in the order of the columns of its design; of an input of pairs their mean."""
    section = scatter_of(dataset)
    names = sorted(str(name).removeprefix(_DRAWN) for name in dataset.coords if str(name).startswith(_DRAWN))
    drawn = {name: dataset[f"{_DRAWN}{name}"] for name in (names if section is None else section.inputs)}
    return {name: each.mean([d for d in each.dims if d != SAMPLE]).values for name, each in drawn.items()}


def is_of_pairs(dataset: xr.Dataset, name: str) -> bool:
    """Whether an input has a draw for each contact pair, or for each surface."""
    return "contact" in dataset[f"{_DRAWN}{name}"].dims


def scatter_of(dataset: xr.Dataset) -> ScatterSection | None:
    """[scatter] of the study of a result; None where it says none."""
    table = tomllib.loads(str(dataset.attrs.get("study", ""))).get("scatter")
    return None if table is None else ScatterSection.model_validate(table)


def _samples(
    dataset: xr.Dataset, values: xr.DataArray, errors: xr.DataArray | None, *, relative: bool
) -> tuple[SampleValues, dict[Hashable, int]]:
    ordered = values.transpose(..., SAMPLE)
    value = np.asarray(ordered.values, dtype=np.float64)
    missing = np.isnan(value)
    reached = np.where(missing, 0.0, value)
    if CYCLE in ordered.dims:
        reached = np.maximum.accumulate(reached, axis=ordered.dims.index(CYCLE))
    if errors is None:
        error = np.full(value.shape, np.inf)
    else:
        error = np.asarray(errors.broadcast_like(ordered).transpose(*ordered.dims).values, dtype=np.float64)
        error = np.where(np.isnan(error), np.inf, error)
    # nothing worn is known to be nothing
    error[missing | (value == 0.0)] = 0.0
    low, high = np.where(missing, reached, value), np.where(missing, np.inf, value)
    if relative:
        error *= low
    sensitive = _is_sensitive(dataset, ordered) & ~missing
    low, high = np.where(sensitive, np.maximum(low - error, 0.0), low), np.where(sensitive, high + error, high)
    error = np.where(sensitive, 0.0, error)
    lengths = {name: length for name, length in ordered.sizes.items() if name != SAMPLE}
    return SampleValues(low, high, error), lengths


def _is_sensitive(dataset: xr.Dataset, like: xr.DataArray) -> NDArray[np.bool_]:
    outcome = dataset["outcome"]
    words = str(outcome.attrs["flag_meanings"]).split()
    numbers = [n for n, word in zip(outcome.attrs["flag_values"], words, strict=True) if word == _SENSITIVE]
    return np.asarray(outcome.isin(numbers).broadcast_like(like).transpose(*like.dims).values)
