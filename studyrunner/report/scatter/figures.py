"""The figures of a study with samples, in their order."""

from __future__ import annotations

from collections.abc import Iterator

from studyrunner.report.drawing import Drawing, Missing
from studyrunner.report.figures.frequency_course import find_course
from studyrunner.report.reading.result import NO_VOLUME, Result
from studyrunner.report.reading.sample_statistics import SAMPLE
from studyrunner.report.scatter.bands import draw_over_course, draw_over_cycles
from studyrunner.report.scatter.deciding import draw_deciding
from studyrunner.report.scatter.exceedance import draw_exceedance
from studyrunner.report.scatter.indices import draw_indices

_TITLE = "Scatter of the worn volume"


def draw_scatter(result: Result) -> Iterator[Drawing | Missing]:
    """Bands, exceedance, indices and deciding input; a sentence where the samples cannot be told of."""
    if SAMPLE not in result.varying:
        return
    statistics = result.statistics
    if statistics is None:
        sentence = (
            result.lacks("worn_volume") or "The file holds more samples than the report takes: read it in Python."
        )
        yield Missing("scatter", _TITLE, sentence)
        return
    if not float(result.read("worn_volume").max()) > NO_VOLUME:
        yield Missing("scatter", _TITLE, "Nothing is worn at the counts kept.")
        return
    if statistics.sizes["cycle"] > 1:
        yield draw_over_cycles(result, statistics)
    course = find_course(result)
    if course is not None:
        yield draw_over_course(result, statistics, course)
    yield draw_exceedance(result, statistics)
    if "input" in statistics.dims:
        yield draw_indices(result, statistics)
        yield draw_deciding(result, statistics)
