"""What the samples of a result, or its one point, say of each measurement: values and errors where it was measured."""

import math
from dataclasses import dataclass

import numpy as np
import xarray as xr

from studyrunner.coordinates import SAMPLE
from studyrunner.measured import QUANTITIES, MeasuredSection, Measurement
from studyrunner.statistics.samples import CYCLE, Array

_RELATIVE = ("worn_volume", "response_amplitude")  # whose errors in a file are relative


@dataclass(frozen=True)
class Computed:
    """What the samples of a result say of one measurement.

    name: of the quantity. at, measured, deviation (m,): where, and what was measured, SI. slow (m,): cycle count of
    each value. counts (k,): of the result. values, error (n, k, m or 1): of each sample at each count.
    """

    name: str
    at: Array
    measured: Array
    deviation: Array
    slow: Array
    counts: Array
    values: Array
    error: Array

    def read(self, sample: int, ratio: Array) -> tuple[Array, Array]:
        """Values and errors (r, m) of a sample, with the count of each times a ratio (r,); NaN beyond its history."""

        def at_counts(series: Array) -> Array:
            columns = np.broadcast_to(series, (len(self.counts), len(self.slow))).T
            rows = zip(self.slow, columns, strict=True)
            return np.stack([np.interp(slow * ratio, self.counts, row, np.nan, np.nan) for slow, row in rows], axis=1)

        return at_counts(self.values[sample]), at_counts(self.error[sample])


def compute_measured(dataset: xr.Dataset, section: MeasuredSection) -> tuple[Computed, ...]:
    """What a result says of everything measured. dataset: with one value of each axis but samples, and the one that is
    measured over.

    Raises ValueError where the result does not hold what was measured, or has further axes.
    """
    return tuple(_compute(dataset, name, each) for name, each in section.all)


def _compute(dataset: xr.Dataset, name: str, measurement: Measurement) -> Computed:
    at, measured, deviation = measurement.numbers
    values = _variable(dataset, name, measurement)
    of_error = QUANTITIES[name].variables[1] if values.name != "wear_depth" else "wear_depth_error"
    if of_error not in dataset:
        raise ValueError(f"measured.{name}: the result holds no {of_error}, ask for it by outputs.variables")
    error = dataset[of_error].astype(float)
    # an error that is not known: the value says nothing; of nothing worn it is none
    size = np.abs(values) if values.name in _RELATIVE else xr.ones_like(values)
    error = (error.fillna(math.inf) * size).where(size != 0.0, 0.0)
    along = {"x": "contact", "cycle": CYCLE}.get(measurement.over, measurement.over)
    wanted, arrays = [each for each in (SAMPLE, CYCLE, along) if each in values.dims], []
    for array in (values, error):
        reduced = array.max("contact") if "contact" in array.dims and along != "contact" else array
        reduced = reduced.isel(response=0) if "response" in reduced.dims else reduced
        if extra := [str(each) for each in reduced.dims if each not in wanted and reduced.sizes[each] > 1]:
            raise ValueError(f"measured.{name}: select one value of {', '.join(extra)} first")
        alone = reduced.squeeze([each for each in reduced.dims if each not in wanted], drop=True)
        arrays.append(measurement.share * alone)
    counts = dataset[CYCLE].values.astype(float) if CYCLE in values.dims else np.zeros(1)
    slow = at if measurement.over == "cycle" else np.full(at.shape, _count_of(measurement, name, counts))
    if slow.max() > counts[-1] * (1.0 + 1e-12):
        remedy = f"the study ends at {counts[-1]:g} cycles, {slow.max():g} were measured: raise slow_time.cycles"
        raise ValueError(f"measured.{name}: {remedy}")
    both = (_placed(dataset, array, along, at, measurement) for array in arrays)
    return Computed(name, at, measured, deviation, slow, counts, *both)


def _count_of(measurement: Measurement, name: str, counts: Array) -> float:
    default = counts[-1] if name == "profile" else counts[0]
    return float(default if measurement.cycle is None else measurement.cycle)


def _variable(dataset: xr.Dataset, name: str, measurement: Measurement) -> xr.DataArray:
    """The variable of a result with a measured quantity, of the pairs or the response that are meant."""
    names = {"profile": ("wear_depth",), "wear_depth": ("wear_depth_max", "wear_depth")}.get(name, (name,))
    found = next((dataset[each] for each in names if each in dataset), None)
    if found is None:
        raise ValueError(f"measured.{name}: the result holds no {names[0]}, ask for it by outputs.variables")
    if measurement.response:
        if measurement.response not in dataset["response"].values.tolist():
            raise ValueError(f"measured.{name}.response: the result has no response {measurement.response!r}")
        found = found.sel(response=[measurement.response])
    return found


def _placed(dataset: xr.Dataset, array: xr.DataArray, along: str, at: Array, measurement: Measurement) -> Array:
    """Values (n, k, m or 1) along the samples, the counts, and where a quantity was measured."""
    for name in (SAMPLE, CYCLE):
        array = array if name in array.dims else array.expand_dims(name)
    if along == CYCLE:
        return np.asarray(array.transpose(SAMPLE, CYCLE).values[..., None], dtype=float)
    whole = np.asarray(array.transpose(SAMPLE, CYCLE, along).values, dtype=float)
    if along == "contact":
        return _on_profile(dataset, whole, at, measurement)
    places = dataset[along].values.astype(float)
    if along == "modal_amplitude":
        places, at = np.log(places), np.log(at)
    order = np.argsort(places)
    # beyond the places nothing is known
    rows = whole[..., order].reshape(-1, len(places))
    inside = [np.interp(at, places[order], row, math.nan, math.nan) for row in rows]
    return np.array(inside).reshape(*whole.shape[:2], len(at))


def _on_profile(dataset: xr.Dataset, whole: Array, at: Array, measurement: Measurement) -> Array:
    """Values (n, k, m) at x of those of all pairs (n, k, n_contact); beyond the pairs nothing is worn.

    Samples may have pairs at places of their own; pairs side by side across the profile count as one.
    """
    shape = len(whole), whole.shape[-1]
    x = np.broadcast_to(dataset["contact_x"].values.astype(float), shape)
    kept = np.full(shape, fill_value=True)
    if measurement.surface and "contact_surface" in dataset:
        kept = np.broadcast_to(dataset["contact_surface"].values.astype(str) == measurement.surface, shape)
    if not kept.any(axis=1).all():
        raise ValueError(f"measured.profile.surface: the result has no surface {measurement.surface!r}")
    mirrored = "x" in str(dataset.attrs.get("contact_mirrored", ""))
    found = np.empty((*whole.shape[:2], len(at)))
    for sample, (own_x, own_kept) in enumerate(zip(x, kept, strict=True)):
        places, inverse, count = np.unique(own_x[own_kept], return_inverse=True, return_counts=True)
        for cycle, values in enumerate(whole[sample][:, own_kept]):
            row = np.bincount(inverse, values) / count
            found[sample, cycle] = np.interp(
                np.abs(at) if mirrored else at, places, row, None if mirrored else 0.0, 0.0
            )
    return found
