"""What the page holds of samples: drawn values, bands, exceedance and indices of each combination of the other axes."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
import xarray as xr

from studyrunner.report.page.encoding import encode_floats
from studyrunner.report.reading.result import NO_VOLUME, Point, Result
from studyrunner.report.reading.sample_statistics import SAMPLE
from studyrunner.report.reading.units import scale_for
from studyrunner.report.scatter.indices import measures_of
from studyrunner.report.scatter.points import drawn_values, ends, last_of, statistics_at
from studyrunner.statistics.ranking import leading_input
from studyrunner.statistics.sentence import sentence

_BANDS = "worn_volume_quantile"
_EXCEEDANCES = (
    ("worn_volume_exceedance", "exceeded_volume", "worn volume"),
    ("wear_depth_exceedance", "exceeded_depth", "largest wear depth"),
)


def build_scatter_numbers(result: Result, floats: float, notes: list[str]) -> dict[str, object] | None:
    """Numbers as the script on the page reads them, in about this number of floats; None without samples.

    `axis`: place of the samples among the axes. `held`: combinations of the other axes, numbered with the last axis
    fastest: all, or the shown one alone where all do not fit; arrays begin with these. `bands`: (count, quantile,
    lowest and highest), `wrong`: the outer ends with the numerical error (count, 2), `gap`: (2), NaN for one group.
    `inputs`: drawn values (sample), `measures` of the inputs (input, lowest and highest) at the last count. All in SI.
    """
    statistics = result.statistics
    if statistics is None or "input" not in statistics.dims or not float(result.worn[result.held].max()) > NO_VOLUME:
        return None
    others = [name for name in result.axes if name != SAMPLE]
    places = list(itertools.product(*(range(result.dataset.sizes[name]) for name in others)))
    points = [dict(zip(others, place, strict=True)) for place in places]
    shown = {name: index for name, index in result.shown_point().items() if name != SAMPLE}
    held = list(range(len(points)))
    if len(points) * _floats_each(statistics, result.dataset.sizes[SAMPLE]) > floats:
        held = [points.index(shown)]
        notes.append(f"The scatter is on this page for one of {len(points)} combinations of the other axes.")
    chosen = [points[number] for number in held]
    each = [statistics_at(statistics, point) for point in chosen]
    last = [last_of(one) for one in each]
    wrong = [ends(one, f"{_BANDS}_error", "cycle", "quantile") for one in each]
    scale = scale_for("m3", result.worn)
    return {
        "axis": result.axes.index(SAMPLE),
        "held": held,
        "cycles": statistics["cycle"].values.astype(float).tolist(),
        "unit": scale.unit,
        "factor": scale.factor,
        "confidence": float(statistics.attrs["confidence"]),
        "bands": encode_floats([ends(one, _BANDS, "cycle", "quantile") for one in each]),
        "wrong": encode_floats([np.stack([one[:, 0, 0], one[:, -1, 1]], axis=-1) for one in wrong]),
        "exceedances": [_exceedance(last, *names) for names in _EXCEEDANCES if names[0] in statistics],
        "inputs": [_input(result, str(name), chosen) for name in statistics["input"].values],
        "deciding": [leading_input(one) for one in last],
        "measures": [
            {
                "name": name,
                "words": words,
                "data": encode_floats([ends(one, name, "input") for one in last]),
                "interval": encode_floats([ends(one, f"{name}_interval", "input") for one in last]),
            }
            for name, words in measures_of(statistics).items()
        ],
        "gap": encode_floats([one["group_gap"].values for one in last]),
        "told": [f"{sentence(one)}." for one in last],
    }


def _floats_each(statistics: xr.Dataset, n_samples: int) -> int:
    """Numbers of one combination."""
    sizes = statistics.sizes
    return 2 * (sizes["cycle"] * (sizes["quantile"] + 1) + 4 * sizes["exceeded_volume"]) + sizes["input"] * (
        n_samples + 8
    )


def _exceedance(last: Sequence[xr.Dataset], name: str, dimension: str, label: str) -> dict[str, object]:
    at = last[0][dimension]
    scale = scale_for(str(at.attrs.get("units", "")), at.values)
    return {
        "label": label,
        "unit": scale.unit,
        "factor": scale.factor,
        "at": encode_floats(at.values),
        "data": encode_floats([ends(one, name, dimension) for one in last]),
        "interval": encode_floats([ends(one, f"{name}_interval", dimension) for one in last]),
    }


def _input(result: Result, name: str, chosen: Sequence[Point]) -> dict[str, object]:
    """An input: drawn values (held, sample), or (sample) where they are the same in all combinations."""
    drawn = [drawn_values(result, name, point) for point in chosen]
    values, (_, units, label) = np.array([one[0] for one in drawn]), drawn[0]
    if (values == values[0]).all():
        values = values[:1]
    scale = scale_for(units, values)
    return {"label": label, "unit": scale.unit, "factor": scale.factor, "data": encode_floats(values)}
