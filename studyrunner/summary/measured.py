"""What a result says of what was measured: how far it is off, or with samples which inputs were identified."""

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from studyrunner.coordinates import SAMPLE
from studyrunner.measured import QUANTITIES, MeasuredSection, Measurement
from studyrunner.result.view import Result
from studyrunner.statistics.computed import Computed, compute_measured
from studyrunner.statistics.identification import TooFewSamplesError, identify
from studyrunner.summary.findings import Finding
from studyrunner.units import show_number, show_percent

_ONE = np.ones(1)
_OVER = {"cycle": "cycle {:.6g}", "x": "x = {:.4g} m", "frequency": "{:.6g} Hz", "modal_amplitude": "{:.3g} m sqrt(kg)"}


def about_measured(result: Result) -> Iterator[Finding]:
    """What a result with [measured] says beside it."""
    section = result.measurements
    if section is None:
        return
    dataset = result.at_one_point(*(each.over for _, each in section.all))
    try:
        if SAMPLE in result.varying:
            yield _identified(identify(dataset))
            return
        pairs = zip(section.all, compute_measured(dataset, section), strict=True)
        yield from (_compared(measurement, computed, section) for (_, measurement), computed in pairs)
    except ValueError as error:
        label = "identified" if isinstance(error, TooFewSamplesError) else "measured"
        yield Finding("identified", label, str(error))


def _identified(found: xr.Dataset) -> Finding:
    texts, confidence = [], 100.0 * found.attrs["confidence"]
    for name in found["input"].values.astype(str):
        one = found.sel(input=name)
        low, middle, high = one["posterior_quantile"].values.tolist()
        before = " to ".join(show_number(each, 3) for each in one["prior_quantile"].values[[0, -1]].tolist())
        units = one["input_units"].item()
        unit = "" if units == "1" else f" {units}"
        known = f"{show_number(middle, 3)} ({show_number(low, 3)} to {show_number(high, 3)}){unit}"
        texts.append(f"{name.replace('_', ' ')} {known}, drawn {before}")
    text = f"{'; '.join(texts)}; intervals of {confidence:g} %, {float(found['n_effective']):.0f} effective samples"
    text += f", the best {float(found['misfit']):.2g} standard deviations off"
    values: dict[str, Any] = {str(name): array.values for name, array in found.data_vars.items()}
    return Finding("identified", "identified", text, {"input": found["input"].values.tolist(), **values})


def _compared(measurement: Measurement, computed: Computed, section: MeasuredSection) -> Finding:
    """The difference E of computation and measurement with its uncertainty, of numerics and data (ASME V&V 20), where
    it is largest over this.
    """
    (value,), (error,) = computed.read(0, _ONE)
    words = computed.name.replace("_", " ")
    if not np.isfinite(value).any():
        return Finding("measured", "measured", f"the result holds no {words} where it was measured")
    data = np.sqrt(computed.deviation**2 + (section.discrepancy * computed.measured) ** 2)
    whole, off = np.sqrt(error**2 / 3.0 + data**2), value - computed.measured
    worst = int(np.nanargmax(np.abs(off) / whole))
    size = abs(float(computed.measured[worst])) or math.nan
    where = _OVER[measurement.over].format(computed.at[worst])
    if not np.isfinite(error[worst]):
        return Finding("measured", "measured", f"{words}: the error of the computed value is not known", {})
    u_num, u_data = (show_percent(float(each[worst]) / size) for each in (error / math.sqrt(3.0), data))
    text = f"{words}: computed less measured E = {100.0 * off[worst] / size:+.3g} % at {where},"
    text += f" {abs(off[worst]) / whole[worst]:.2g} times its standard uncertainty (u_num {u_num}, u_D {u_data})"
    text += f", the largest of {len(value)}" if len(value) > 1 else ""
    values = {"quantity": computed.name, "units": QUANTITIES[computed.name].units, "at": computed.at}
    values |= {"computed": value, "measured": computed.measured, "error": error, "deviation": data}
    return Finding("measured", "measured", text, values)
