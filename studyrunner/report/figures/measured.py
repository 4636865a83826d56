"""What was measured beside what was computed, and the inputs that follow from it."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes

from studyrunner.coordinates import SAMPLE
from studyrunner.measured import QUANTITIES, Measurement
from studyrunner.report import drawing as plot
from studyrunner.report.drawing import COLOURS, Drawn
from studyrunner.result.view import Result
from studyrunner.statistics.computed import Computed, compute_measured
from studyrunner.statistics.identification import (
    TooFewSamplesError,
    describe_posterior,
    identify,
    weigh_samples,
    weighted_quantiles,
)
from studyrunner.statistics.samples import Array
from studyrunner.units import scale_for

_OVER = {"cycle": "cycles", "x": "m", "frequency": "Hz", "modal_amplitude": "m sqrt(kg)"}
_ENDS = np.array([0.05, 0.5, 0.95])
_LOOK: dict[str, Any] = {"color": "black", "linestyle": "none", "capsize": 2.5, "markersize": 4, "zorder": 3}


def draw_measured(result: Result) -> Drawn:
    """A panel for each measured quantity: measured values with their deviations beside computed ones, of samples bands
    of 90 %, before and with what was measured.
    """
    section = result.measurements
    if section is None:
        return None
    dataset = result.at_one_point(*(each.over for _, each in section.all))
    why, bands = "", tuple[Array, ...]()
    try:
        computed = compute_measured(dataset, section)
        if SAMPLE in result.varying:
            weighed = weigh_samples(dataset, section)
            describe_posterior(weighed)
            bands = weighed.bands(_ENDS)
    except TooFewSamplesError as error:
        why = str(error)
    except ValueError as error:
        return str(error)
    figure, panels = plot.new_panels(1, len(computed), 3.0)
    for place, (panel, each, (_, measurement)) in enumerate(zip(panels[0], computed, section.all, strict=True)):
        _draw(panel, each, measurement, bands[place] if bands else None)
    return figure, why


def _draw(panel: Axes, computed: Computed, measurement: Measurement, posterior: Array | None) -> None:
    """One quantity over its places, or over the cycles of the file. posterior (k, 3): band with what was measured."""
    over = measurement.over
    along_counts = computed.values.shape[2] == 1
    at = computed.counts if along_counts else computed.at
    values, error = computed.values[..., 0], computed.error[..., 0]
    if not along_counts:
        pairs = [computed.read(sample, np.ones(1)) for sample in range(len(computed.values))]
        values, error = (np.array([pair[part][0] for pair in pairs]) for part in (0, 1))
    scale, way = scale_for(QUANTITIES[computed.name].units, computed.measured), scale_for(_OVER[over], computed.at)
    x = way(at)
    if len(values) == 1:
        plot.add_line(panel, x, scale(values[0]), scale(error[0]), band=True, color=COLOURS[0], label="computed")
    else:
        known = [column[np.isfinite(column)] for column in values.T]
        prior = np.array([weighted_quantiles(each, np.ones(each.shape), _ENDS) for each in known])
        bands = [("drawn", prior, COLOURS[0])]
        if posterior is not None:
            bands.append(("with what was measured", posterior, COLOURS[1]))
        for label, band, colour in bands:
            panel.fill_between(x, scale(band[:, 0]), scale(band[:, 2]), color=colour, alpha=0.25, lw=0.0, label=label)
            panel.plot(x, scale(band[:, 1]), color=colour, label=f"_{label}")
    panel.errorbar(
        way(computed.at), scale(computed.measured), scale(computed.deviation), fmt="o", label="measured", **_LOOK
    )
    panel.set(xlabel=way.label({"cycle": "vibration cycles"}.get(over, over.replace("_", " "))))
    panel.set_ylabel(scale.label(computed.name.replace("_", " ") if computed.name != "profile" else "wear depth"))


def draw_identified(result: Result) -> Drawn:
    """A panel for each input: how probable its values are, as drawn and with what was measured."""
    section = result.measurements
    if section is None or SAMPLE not in result.varying:
        return None
    try:
        found = identify(result.at_one_point(*(each.over for _, each in section.all)))
    except ValueError as error:
        return str(error)
    names = found["input"].values.astype(str)
    figure, panels = plot.new_panels(1, len(names), 2.4)
    for panel, name in zip(panels[0], names, strict=True):
        one = found.sel(input=name)
        units = one["input_units"].item()
        scale = scale_for(units, one["prior_quantile"].values)
        for place, (key, label) in enumerate((("prior", "drawn"), ("posterior", "with what was measured"))):
            low, middle, high = scale(one[f"{key}_quantile"].values)
            panel.plot([low, high], [place, place], color=COLOURS[place], linewidth=6, alpha=0.4, label=label)
            panel.plot(middle, place, color=COLOURS[place], marker="o", label=f"_{label}")
        panel.set(yticks=[], ylim=(1.6, -0.6), xlabel=scale.label(name.replace("_", " ")))
    text = f"Intervals of {100.0 * found.attrs['confidence']:g} %, dots: medians;"
    return figure, f"{text} {float(found['n_effective']):.0f} effective samples"
