"""The last lines of a run with samples: what the result says of them."""

from __future__ import annotations

from pathlib import Path

import xarray as xr

from studyrunner.statistics.sentence import sentences
from studyrunner.statistics.study_statistics import worn_volume_statistics

_MOST_LINES = 20


def describe_samples(path: Path) -> list[str]:
    """A line for each point of a result that the run has just written, the first twenty; none without worn volumes."""
    with xr.open_dataset(path, engine="netcdf4", decode_times=False) as dataset:
        if "worn_volume" not in dataset:
            return []
        statistics = worn_volume_statistics(dataset)
        if "excitation_frequency" in dataset and "mission" not in dataset.dims:
            # the coordinate is the middle of the range of a frequency that is followed
            statistics = statistics.squeeze("frequency", drop=True)
        lines = sentences(statistics)
    more = [f"and {len(lines) - _MOST_LINES} more points"] if len(lines) > _MOST_LINES else []
    return lines[:_MOST_LINES] + more
