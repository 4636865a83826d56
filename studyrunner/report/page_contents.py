"""Figures and tables of the report, in the order of the page."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from studyrunner.report.drawing import Drawing, Missing, Table, style
from studyrunner.report.figures.excitation import draw_excitation
from studyrunner.report.figures.flank import draw_flanks, draw_wear
from studyrunner.report.figures.loops import draw_loops
from studyrunner.report.figures.missions import draw_missions
from studyrunner.report.figures.modes import draw_modes
from studyrunner.report.figures.outcome import draw_certificates, draw_outcomes, list_branches, list_stability
from studyrunner.report.figures.response import draw_responses
from studyrunner.report.figures.sector import OF_SECTOR, draw_sector
from studyrunner.report.figures.volume import draw_volumes
from studyrunner.report.precision.comparison import study_precision
from studyrunner.report.precision.figures import draw_precision
from studyrunner.report.reading.result import Result
from studyrunner.report.reading.scene_pairs import of_shown_scene
from studyrunner.report.root.figures import draw_root
from studyrunner.report.root.mode_fractions import draw_mode_fractions
from studyrunner.report.scatter.figures import draw_scatter
from studyrunner.report.trends.figures import draw_trends

Item = Drawing | Missing | Table
_Part = Callable[[Result], Iterator[Item]]


def draw_report(result: Result) -> Iterator[Item]:
    """Figures, tables, and sentences about what is missing: the results, then how far they are to be trusted.

    Where no point holds a state, the results are left out with a single sentence. Of nonlinear modes there are figures
    over the amplitude, and a sentence in place of those of wear. Of missions there are figures of their blocks in place
    of those of single states.
    """
    of_results: tuple[_Part, ...] = (
        draw_scatter,
        draw_trends,
        draw_responses,
        draw_volumes,
        draw_excitation,
        *map(_of_pairs, (draw_root, draw_flanks, draw_loops)),
    )
    if result.blocks is not None:
        of_results = (draw_scatter, draw_trends, draw_missions, draw_volumes, *map(_of_pairs, (draw_root, draw_wear)))
    if result.has_modes:
        of_results = (draw_modes, _of_pairs(draw_mode_fractions), _tell_no_wear)
    if not result.held.any():
        of_results = (_tell_nothing,)
    of_states: tuple[_Part, ...] = (list_branches, list_stability, draw_certificates, _draw_precision)
    if result.has_modes:
        of_states = ()
    elif result.blocks is not None:
        of_states = (draw_certificates,)
    parts = (
        draw_outcomes,
        *(() if result.has_modes else (lambda result: draw_sector(of_shown_scene(result, OF_SECTOR)),)),
        *of_results,
        *of_states,
    )
    for part in parts:
        # The style is that of the whole process: it is not left on while the caller has the word.
        with style():
            items = list(part(result))
        yield from items


def _of_pairs(part: _Part) -> _Part:
    """Where scenes differ in their pairs, figures of pairs show the scene of the shown point."""
    return lambda result: part(of_shown_scene(result))


def _draw_precision(result: Result) -> Iterator[Item]:
    """Error against run time, where the axes of the study are settings of the solver."""
    precision = study_precision(result)
    if precision is not None:
        yield from draw_precision(precision)


def _tell_no_wear(_result: Result) -> Iterator[Missing]:
    said = "A study with [axes] modal_amplitude has no excitation and no slow time: give [axes] frequency for these."
    yield Missing("wear", "Frequency response, worn volume, wear depth, fretting loops", said)


def _tell_nothing(_result: Result) -> Iterator[Missing]:
    yield Missing("results", "Results", "No point was computed: the file holds no results to draw.")
