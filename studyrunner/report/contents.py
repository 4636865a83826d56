"""Figures and tables of the report, in the order of the page."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from studyrunner.report.drawing import Item, Missing, style
from studyrunner.report.figures.history import draw_excitation, draw_history
from studyrunner.report.figures.loops import draw_fretting, draw_motion, draw_normal
from studyrunner.report.figures.missions import draw_missions
from studyrunner.report.figures.modes import draw_modes
from studyrunner.report.figures.outcome import draw_outcomes, list_certificates
from studyrunner.report.figures.pairs import draw_numbers, draw_pairs, draw_wear
from studyrunner.report.figures.precision import draw_precision
from studyrunner.report.figures.response import draw_after_wear, draw_responses
from studyrunner.report.figures.scatter import draw_scatter
from studyrunner.report.figures.sector import OF_SECTOR, draw_sector
from studyrunner.report.figures.trends import draw_trends
from studyrunner.report.figures.volume import draw_final, draw_map
from studyrunner.report.root.figures import draw_mode_fractions, draw_root
from studyrunner.result.scene_pairs import of_shown_scene
from studyrunner.result.view import Result

_Part = Callable[[Result], Iterator[Item]]


def _one(draw: Callable[[Result], Item | None], name: str = "", title: str = "", *needs: str) -> _Part:
    """A figure; a sentence where the file lacks variables that it needs."""

    def part(result: Result) -> Iterator[Item]:
        if lacks := result.lacks(*needs):
            yield Missing(name, title, lacks)
        elif (item := draw(result)) is not None:
            yield item

    return part


_VOLUMES = (
    _one(draw_history, "worn_volume", "Worn volume over cycles", "worn_volume"),
    _one(draw_final, "final_worn_volume", "Final worn volume", "worn_volume"),
    _one(lambda result: draw_map(result, "worn_volume"), "worn_volume_map", "Map of the worn volume", "worn_volume"),
    _one(
        lambda result: draw_map(result, "wear_rate"),
        "wear_rate_map",
        "Map of the wear rate",
        "worn_volume",
        "wear_rate",
    ),
)
_RESPONSES = (
    _one(draw_responses, "frequency_response", "Frequency response", "response_amplitude"),
    _one(draw_after_wear, "response_after_own_wear", "Response of different joints", "response_amplitude"),
    _one(draw_excitation),
)
_LOOPS = (_one(draw_fretting), _one(draw_normal), _one(draw_motion))


def draw_report(result: Result) -> Iterator[Item]:
    """Figures, tables, and sentences about what is missing: the results, then how far they are to be trusted."""
    for part in _choose_parts(result):
        # The style is that of the whole process: it is not left on while the caller has the word.
        with style():
            items = list(part(result))
        yield from items


def _choose_parts(result: Result) -> tuple[_Part, ...]:
    """What draws the items: of wear histories, of missions, or of nonlinear modes; no results where there are none."""
    if not result.held.any():
        return (draw_outcomes, _draw_sector, _tell_nothing)
    if result.has_modes:
        return (draw_modes, *map(_of_pairs, (draw_mode_fractions, draw_numbers)), draw_outcomes)
    if result.blocks is not None:
        of_pairs = map(_of_pairs, (draw_root, draw_wear, draw_numbers))
        own = (draw_missions, draw_scatter, draw_trends, *_VOLUMES, *of_pairs)
        return (*own, _draw_sector, draw_outcomes, list_certificates)
    of_pairs = map(_of_pairs, (draw_root, draw_pairs, *_LOOPS, draw_numbers))
    own = (draw_scatter, *_VOLUMES, *_RESPONSES, draw_trends, *of_pairs)
    return (*own, _draw_sector, draw_outcomes, list_certificates, draw_precision)


def _of_pairs(part: _Part) -> _Part:
    """Where scenes differ in their pairs, figures of pairs show the scene of the shown point."""
    return lambda result: part(of_shown_scene(result))


def _draw_sector(result: Result) -> Iterator[Item]:
    return draw_sector(of_shown_scene(result, OF_SECTOR))


def _tell_nothing(_result: Result) -> Iterator[Item]:
    yield Missing("results", "Results", "No point was computed: the file holds no results to draw.")
