"""What the samples of a result file say: statistics of the worn volume, within limits of time and memory."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr
from pydantic import ValidationError

from studyrunner.result.endings import Ending
from studyrunner.scatter.design import SaltelliLayout
from studyrunner.scatter.section import ScatterSection
from studyrunner.statistics.study_statistics import worn_volume_statistics

QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)
"""Probabilities of the bands that figures show."""

SAMPLE = "sample"
DRAWN = "sample_"
"""How the coordinates with drawn values begin."""

_FEWEST = 2
_MOST_VALUES, _MOST_OF_ALL = 10**6, 10**7
"""Worn volumes from which on only some of the cycle counts are used, and none: a million take some 30 s."""


def statistics_of(
    dataset: xr.Dataset, study: Mapping[str, Mapping[str, object]], endings: Mapping[int, Ending]
) -> xr.Dataset | None:
    """Statistics at all points and cycle counts, or at some of these, evenly spaced, where there are many.

    Parameters
    ----------
    dataset
        A result that the schema check has passed.
    study
        Its tables.
    endings
        What the numbers of its outcomes mean.

    Returns
    -------
    xr.Dataset | None
        See `worn_volume_statistics`; None without samples, without worn volumes, or with too many of them.
    """
    if dataset.sizes.get(SAMPLE, 0) < _FEWEST or "worn_volume" not in dataset:
        return None
    worn = dataset["worn_volume"]
    per_count = worn.size // worn.sizes["cycle"]
    if 2 * per_count > _MOST_OF_ALL:
        return None
    keep = max(2, _MOST_VALUES // per_count)
    if keep < worn.sizes["cycle"]:
        kept = np.unique(np.linspace(0, worn.sizes["cycle"] - 1, keep).astype(int))
        dataset = dataset.isel(cycle=kept)
    words = " ".join(ending.word for ending in endings.values())
    named = dataset["outcome"].assign_attrs(flag_values=list(endings), flag_meanings=words)
    dataset = dataset.assign(outcome=named)
    if not _fits(dataset, study.get("scatter")):
        # drawn values say enough where the study says nothing, or something else
        dataset = dataset.assign_attrs(study="")
    return worn_volume_statistics(dataset, QUANTILES)


def _fits(dataset: xr.Dataset, table: object) -> bool:
    """Whether [scatter] of the study is of the samples of the file."""
    try:
        section = ScatterSection.model_validate(table)
    except ValidationError:
        return False
    rows = SaltelliLayout(len(section.inputs)).rows_per_base if section.method == "saltelli" else 1
    has_all = all(f"{DRAWN}{name}" in dataset.coords for name in section.inputs)
    return has_all and dataset.sizes[SAMPLE] % rows == 0
