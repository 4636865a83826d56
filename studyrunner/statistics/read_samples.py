"""The samples of a result: which there are, of which study, and values of a variable with their bounds and errors."""

import tomllib
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from studyrunner.coordinates import SAMPLE
from studyrunner.scatter import ScatterSection
from studyrunner.statistics.samples import CYCLE, DRAWN, SampleValues
from studyrunner.variables import in_metres

LIFE = "cycles_to_target"
RESPONSE = "response_amplitude"


def study_of(dataset: xr.Dataset) -> dict[str, Any]:
    """The study of a result; empty where it has none."""
    try:
        return tomllib.loads(str(dataset.attrs.get("study", "")))
    except ValueError:
        return {}


def scatter_of(dataset: xr.Dataset) -> ScatterSection | None:
    """[scatter] of the study of a result; None where there is none that fits the samples of the file."""
    try:
        section = ScatterSection.model_validate(study_of(dataset).get("scatter"))
    except ValueError:
        return None
    has_all = all(f"{DRAWN}{name}" in dataset.coords for name in section.inputs)
    return section if has_all and dataset.sizes[SAMPLE] % section.rows_a_sample == 0 else None


def come_to(dataset: xr.Dataset) -> tuple[ScatterSection | None, NDArray[np.intp]]:
    """[scatter], as `scatter_of`, and numbers of the samples that the run has come to at all points.

    Of a Saltelli design whole base samples.
    """
    left, section = _ended(dataset, "not_computed"), scatter_of(dataset)
    left = left.any([name for name in left.dims if name != SAMPLE])
    base = 1 if section is None else section.rows_a_sample
    return section, np.flatnonzero(~left.values.reshape(-1, base).any(axis=1).repeat(base))


def _ended(dataset: xr.Dataset, word: str) -> xr.DataArray:
    """Points with this outcome."""
    outcome: xr.DataArray = dataset["outcome"]
    words = dict(zip(outcome.attrs["flag_meanings"].split(), np.atleast_1d(outcome.attrs["flag_values"]), strict=False))
    return outcome.isin(words.get(word, -1))


def in_cycles_of(dataset: xr.Dataset) -> xr.Dataset:
    """A result of missions as one of cycles."""
    in_cycles = with_responses(dataset.drop_dims("block", errors="ignore"), dataset)
    names = {"mission": CYCLE, "missions_to_target": LIFE, "last_mission": "last_cycle"}
    names["missions_to_target_error"] = f"{LIFE}_error"
    return in_cycles.rename({old: new for old, new in names.items() if old in in_cycles.variables})


def with_responses(dataset: xr.Dataset, blocks: xr.Dataset) -> xr.Dataset:
    """With the largest response of all blocks, and the largest error."""
    return dataset.assign({name: blocks[name].max("block") for name in (RESPONSE, "response_error") if name in blocks})


def read_samples(dataset: xr.Dataset, name: str) -> tuple[SampleValues, tuple[str, ...]]:
    """Samples of a variable of a result, and the dimensions before them: worn_volume, m3, wear_depth_max, m, or
    wear_depth, m, of which the deepest pair counts, with the largest error of any pair; the largest
    response_amplitude, m, up to a count; cycles_to_target.

    What was not computed lies above the last value that was, without upper bound. What is `sensitive`, or known to have
    no known error, lies within its error, which may be infinite. An error that is not in the file is infinite.
    """
    values = dataset[name].astype(float)
    of_error = "response_error" if name == RESPONSE else f"{name}_error"
    errors = dataset.get(of_error, xr.full_like(values, np.inf))
    if "contact" in values.dims:
        values, errors = values.max("contact"), errors.max("contact")
    if "response" in values.dims:
        values = values.isel(response=in_metres(values["response"].values)).max("response")
        errors = errors.max("response") if "response" in errors.dims else errors
    values = values.transpose(..., SAMPLE)
    value, missing = values.values, values.isnull().values
    sensitive = _ended(dataset, "sensitive").broadcast_like(values).transpose(*values.dims).values
    low, high = np.where(missing, 0.0, value), np.where(missing, np.inf, value)
    error = errors.fillna(np.inf).broadcast_like(values).transpose(*values.dims).values.copy()
    # nothing worn is known to be nothing
    error[missing | (value == 0.0)] = 0.0
    if name in ("worn_volume", RESPONSE):
        # its error is relative
        error *= low
    if CYCLE in values.dims:
        # wear never falls, nor does the largest response
        axis = values.dims.index(CYCLE)
        largest = np.maximum.accumulate(low, axis=axis)
        low, high = np.where(missing, largest, low), high
        if name == RESPONSE:
            low, high, error = largest, np.where(missing, np.inf, largest), np.maximum.accumulate(error, axis=axis)
    if name == LIFE:
        reached = dataset["last_cycle"].fillna(0.0).transpose(*values.dims).values
        low = np.where(missing, np.where(sensitive, 0.0, reached), low)
    unknown = np.isinf(error) & (of_error in dataset)
    found = SampleValues(low, high, error).widened((sensitive | unknown) & ~missing)
    return replace(found, low=np.maximum(found.low, 0.0)), tuple(map(str, values.dims[:-1]))
