"""All sectors of a ring: their amplitudes over the course, what each of them wears, and how far they differ."""

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.ticker import MaxNLocator

from studyrunner.coordinates import SAMPLE
from studyrunner.report import drawing as plot
from studyrunner.report.drawing import Drawn, FloatArray
from studyrunner.report.selection import find_course
from studyrunner.result.view import NO_VOLUME, Result
from studyrunner.units import scale_for, show_percent

_AMPLITUDE, _WORN, _DEPTH = "sector_amplitude", "sector_worn_volume", "sector_wear_depth"
_FEWEST_BINS, _MOST_BINS = 5, 30


def _wears(result: Result) -> bool:
    return len(result.cycles) > 1 and float(np.nanmax(result.dataset[_WORN].values, initial=0.0)) > NO_VOLUME


def draw_amplitudes(result: Result) -> Drawn:
    """Amplitude of each sector over the course, of the new joint and of the worn one; nothing of other results."""
    course = find_course(result) if result.has(_AMPLITUDE) else None
    if course is None:
        return None
    choice, counts = course.choose(1), [0, -1] if _wears(result) else [0]
    fields = course.read(_AMPLITUDE, *choice.points)[0][:, counts]  # (n, counts, sector)
    scale = scale_for("m", fields[np.isfinite(fields)])
    labels = [result.cycle_label(count) for count in counts]
    figure, panels = plot.panel_grid(labels, 2.9, sharex=True)
    norm = Normalize(0.0, scale(np.nanmax(fields)).item() or 1.0)
    edges = np.arange(fields.shape[-1] + 1) - 0.5
    for panel, field in zip(panels.flat, np.moveaxis(fields, 1, 0), strict=True):
        plot.add_map(panel, course.edges, edges, scale(field.T), norm)
        course.set_axis(panel)
        panel.set_ylabel("sector")
        panel.yaxis.set_major_locator(MaxNLocator(integer=True))
    plot.label_outer(panels)
    plot.add_colour_bar(figure, panels, norm, scale.label("amplitude"))
    place, count, sector = map(int, np.unravel_index(int(np.nanargmax(fields)), fields.shape))
    largest = f"{scale.show(float(fields[place, count, sector]), 4)} of sector {sector} at {course.at(place)}"
    return figure, f"Largest: {largest}, {labels[count]}", choice.sentence


def draw_sectors(result: Result) -> Drawn:
    """Amplitude, worn volume and deepest wear of each sector at the shown point; nothing of other results."""
    if not result.has(_WORN):
        return None
    last, wears, shown = result.last_reached(result.shown), _wears(result), list[tuple[str, str, FloatArray]]()
    ends = [0, last] if wears else [0]
    if result.has(_AMPLITUDE):
        shown.append(("amplitude", "m", result.at(_AMPLITUDE, result.shown, ends).values))
    for name in (_WORN, _DEPTH) if wears else ():
        shown.append(
            (
                name.removeprefix("sector_").replace("_", " "),
                str(result.dataset[name].attrs["units"]),
                result.at(name, result.shown, [last]).values,
            )
        )
    if not shown:
        return None
    figure, panels = plot.new_panels(1, len(shown), 2.8)
    sectors = result.dataset["sector"].values
    for panel, (label, units, rows) in zip(panels[0], shown, strict=True):
        scale = scale_for(units, rows[np.isfinite(rows)])
        for number, (row, count) in enumerate(zip(rows, ends[-len(rows) :], strict=True)):
            style = plot.line_style(number + (len(rows) == 1 and wears)) | {"linestyle": "none", "markevery": 1}
            panel.vlines(sectors, 0.0, scale(row), color=style["color"], linewidth=1.2)
            panel.plot(sectors, scale(row), label=result.cycle_label(count), **style)
        panel.set(xlabel="sector", ylabel=scale.label(label))
        plot.set_from_zero(panel)
        panel.xaxis.set_major_locator(MaxNLocator(integer=True))
        panel.grid(visible=False, axis="x")
    text = ""
    if wears:
        worn = np.nan_to_num(result.at(_WORN, result.shown, last).values)
        text = f"Sector {int(worn.argmax())} has {show_percent(float(worn.max() / worn.sum()))} of the wear of all"
    return figure, text


def draw_magnification(result: Result) -> Drawn:
    """How far the largest amplitude is above the mean of all sectors: a histogram of the samples, else over the course;
    nothing of other results.
    """
    course = find_course(result) if result.has(_AMPLITUDE) else None
    if not result.has(_AMPLITUDE) or (course is None and SAMPLE not in result.varying):
        return None
    if SAMPLE in result.varying:
        return _of_samples(result, None if course is None else course.axis)
    assert course is not None
    choice = course.choose(1)
    values = course.read("amplitude_magnification", *choice.points)[0]
    figure, panel = plot.new_panel(3.0)
    for number, count in enumerate([0, -1] if _wears(result) else [0]):
        style = course.line_style(number) | {"markevery": 1}
        panel.plot(course.values, values[:, count], label=result.cycle_label(count), **style)
    panel.set_ylabel("largest over mean amplitude")
    course.set_axis(panel)
    return figure, f"At most {np.nanmax(values):.4g}", choice.sentence


def _of_samples(result: Result, axis: str | None) -> Drawn:
    """Histogram of the samples at the shown point; over the course the largest amplitude over the largest mean."""
    others = {name: [at] for name, at in result.shown.items() if name not in (SAMPLE, axis)}
    whole = result.dataset[_AMPLITUDE].isel(others).isel(cycle=0)
    kept = [name for name in whole.dims if name != SAMPLE]
    means = whole.mean("sector").max([name for name in kept if name != "sector"])
    factors = (whole.max(kept) / means).values
    factors = factors[np.isfinite(factors)]
    if not factors.size:
        return None
    figure, panel = plot.new_panel(3.0)
    n_bins = int(np.clip(np.sqrt(factors.size), _FEWEST_BINS, _MOST_BINS))
    panel.hist(factors, n_bins, color=plot.COLOURS[0])
    panel.set(xlabel="largest over mean amplitude", ylabel="samples")
    panel.yaxis.set_major_locator(MaxNLocator(integer=True))
    middle, high = np.quantile(factors, (0.5, 0.95))
    over = f", each over all values of {axis.replace('_', ' ')}" if axis else ""
    text = f"{factors.size} samples of the new joint{over}: median {middle:.4g}, 95 % below {high:.4g}, at most"
    return figure, f"{text} {factors.max():.4g}"
