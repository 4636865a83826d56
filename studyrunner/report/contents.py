"""The table of figures: all figures and tables of the report, in the order of the page."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

from studyrunner.report.drawing import Item, Missing, style
from studyrunner.report.figures import (
    history,
    loops,
    missions,
    modes,
    outcome,
    pairs,
    precision,
    response,
    scatter,
    sector,
    trends,
    volume,
)
from studyrunner.report.root import figures as root
from studyrunner.result.scene_pairs import OF_PAIRS, of_shown_scene
from studyrunner.result.view import Result

WEAR, MISSIONS, MODES = "wear histories", "missions", "modes"
"""Kinds of results."""


@dataclass(frozen=True)
class Entry:
    """A line of the table: one figure or table of the report.

    name: of its files. shows: in words. draw: makes it; None where there is nothing to see. needs: variables without
    which a sentence says what to ask for. kinds: of the results that have it. scene: where scenes of a study differ in
    these variables, that of the shown point is drawn. always: also where no point has a result.
    """

    name: str
    shows: str
    draw: Callable[[Result], Item | None]
    needs: tuple[str, ...]
    kinds: tuple[str, ...]
    scene: tuple[str, ...] = ()
    always: bool = False

    def make(self, result: Result) -> Item | None:
        """The figure, a sentence in its place, or None."""
        if lacks := result.lacks(*self.needs):
            return Missing(self.name, self.shows[0].upper() + self.shows[1:], lacks)
        return self.draw(of_shown_scene(result, self.scene) if self.scene else result)


def _of(*kinds: str, rows: tuple[tuple[Any, ...], ...], **options: Any) -> tuple[Entry, ...]:
    """Entries of these kinds of results. rows: name, what it shows, function, and what it needs."""
    return tuple(Entry(name, shows, draw, tuple(needs), kinds, **options) for name, shows, draw, *needs in rows)


_BLOCKS = (
    ("blocks", "blocks of a mission with their wear (table)", missions.list_blocks),
    ("block_shares", "wear by block over the missions", missions.draw_shares),
    ("block_responses", "vibration of each block over the missions", missions.draw_responses),
)
_MODES = (
    ("natural_frequency", "natural frequency of a mode over its amplitude",
     partial(modes.draw_mode, name="natural_frequency"), "natural_frequency"),
    ("damping_ratio", "damping ratio of a mode over its amplitude",
     partial(modes.draw_mode, name="damping_ratio"), "damping_ratio"),
)  # fmt: skip
_SAMPLES = (
    ("worn_volume_bands", "worn volume of the samples over cycles, with bands", scatter.draw_bands),
    ("worn_volume_bands_course", "the same over frequency at the last count", scatter.draw_bands_over_course),
    ("exceedance", "probability of more wear", scatter.draw_exceedance),
    ("deciding_inputs", "what each input decides, with its interval", scatter.draw_deciding_inputs),
    ("deciding_input", "samples over the input that decides most", scatter.draw_deciding_input),
)
_VOLUMES = (
    ("worn_volume", "worn volume over cycles", history.draw_history, "worn_volume"),
    ("final_worn_volume", "worn volume at the last count over frequency", volume.draw_final, "worn_volume"),
    ("worn_volume_map", "worn volume over frequency and cycles",
     partial(volume.draw_map, name="worn_volume"), "worn_volume"),
    ("wear_rate_map", "wear rate over frequency and cycles",
     partial(volume.draw_map, name="wear_rate"), "worn_volume", "wear_rate"),
)  # fmt: skip
_RESPONSES = (
    ("frequency_response", "response curve of the new joint and of one worn joint", response.draw_responses,
     "response_amplitude"),
    ("response_after_own_wear", "response of different joints, each after wear at its own frequency",
     response.draw_after_wear, "response_amplitude"),
    ("excitation_frequency", "frequency of an excitation that follows the resonance", history.draw_excitation),
)  # fmt: skip
_ROOT = (
    ("worn_root", "worn root in three dimensions, wear exaggerated", root.draw_root),
    ("whole_disk", "all sectors of the disk", root.draw_disk),
    ("wear_depth", "wear depth of each pair", pairs.draw_depths),
    ("worn_profile", "wear depth on the flanks, or the scar over x", pairs.draw_profile),
)
_PAIRS = (
    ("mean_pressure", "mean pressure, first and last count", pairs.draw_pressure, "mean_pressure"),
    ("fretting_loops", "tangential force over displacement through a period", loops.draw_fretting),
    ("normal_load", "normal force through a period", loops.draw_normal),
    ("pair_motion", "motion of pairs in the contact plane", loops.draw_motion),
)
_FRACTIONS = (
    ("slip_fraction", "fraction of the period in slip, on the root", root.draw_slip, "slip_fraction"),
    ("open_fraction", "fraction of the period open, on the root", root.draw_open, "open_fraction"),
)
_SECTOR = (("natural_frequencies", "sector and its natural frequencies", sector.draw_sector),)

FIGURES = (
    *_of(MISSIONS, rows=_BLOCKS),
    *_of(MODES, rows=_MODES),
    *_of(WEAR, MISSIONS, rows=_SAMPLES + _VOLUMES),
    *_of(WEAR, rows=_RESPONSES),
    *_of(WEAR, MISSIONS, rows=(("trends", "wear, peak and its shift along every axis", trends.draw_trends),)),
    *_of(WEAR, MISSIONS, rows=_ROOT, scene=OF_PAIRS),
    *_of(WEAR, rows=_PAIRS, scene=OF_PAIRS),
    *_of(MODES, rows=_FRACTIONS, scene=OF_PAIRS),
    *_of(WEAR, MISSIONS, MODES, rows=(("pair_numbers", "numbers of the pairs", pairs.draw_numbers),), scene=OF_PAIRS),
    *_of(WEAR, MISSIONS, rows=_SECTOR, scene=sector.OF_SECTOR, always=True),
    *_of(WEAR, MISSIONS, MODES, rows=(("outcome_map", "how the points ended", outcome.draw_outcomes),), always=True),
    *_of(WEAR, MISSIONS, rows=(("certificates", "worst certificates (table)", outcome.list_certificates),)),
    *_of(WEAR, rows=(("precision", "error against run time", precision.draw_precision),)),
    *_of(WEAR, rows=(("precision_settings", "all settings with their errors (table)", precision.list_settings),)),
)
"""The figures of all results."""


def draw_report(result: Result) -> Iterator[Item]:
    """Figures, tables, and sentences about what is missing: the results, then how far they are to be trusted."""
    kind = MODES if result.has_modes else WEAR if result.blocks is None else MISSIONS
    has_results = bool(result.held.any())
    for entry in FIGURES:
        if kind in entry.kinds and (has_results or entry.always):
            # the style is that of the whole process: it is not left on while the caller has the word
            with style():
                item = entry.make(result)
            if item is not None:
                yield item
    if not has_results:
        yield Missing("results", "Results", "No point was computed: the file holds no results to draw.")


def list_figures() -> str:
    """The table of figures for the page REPORT."""
    only: dict[tuple[str, ...], str] = {(MISSIONS,): f" ({MISSIONS})", (MODES,): f" ({MODES})"}
    rows = [f"| `{entry.name}` | {entry.shows}{only.get(entry.kinds, '')} |" for entry in FIGURES]
    return "\n".join(("| file | shows |", "|---|---|", *rows))
