"""The table of figures: all figures and tables of the report, in the order of the page."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, cast

from studyrunner.report.drawing import COLUMN_WIDTH, WIDTH, Drawing, Drawn, Item, Missing, Table, style
from studyrunner.report.figures import (
    contact,
    loops,
    missions,
    outcome,
    precision,
    response,
    scatter,
    sector,
    trends,
    wear,
)
from studyrunner.report.root import figures as root
from studyrunner.result.scene_pairs import OF_PAIRS, of_shown_scene
from studyrunner.result.view import Result

WEAR, MISSIONS, MODES = "wear histories", "missions", "modes"
"""Kinds of results."""

POINT, COURSE = "frequency, scheme and what else varies", "the axis that figures are drawn over"
"""What a title names of the shown point."""


@dataclass(frozen=True)
class Entry:
    """A line of the table: one figure or table of the report.

    name: of its files. title: {slow} stands for cycles or missions, {over} for the axis that figures are drawn over;
    (table) is left out of the heading. draw: makes it. kinds: of the results that have it. needs: variables without
    which a sentence says what to ask for. scene: where scenes of a study differ in these variables, that of the shown
    point is drawn. at: what the title names of the shown point, `POINT` or `COURSE`. always: also where no point has a
    result.
    """

    name: str
    title: str
    draw: Callable[[Result], Drawn]
    kinds: tuple[str, ...] = (WEAR, MISSIONS)
    needs: tuple[str, ...] = ()
    scene: tuple[str, ...] = ()
    at: str = ""
    always: bool = False

    def make(self, result: Result) -> Item | None:
        """The figure, a sentence in its place, or None."""
        over = (result.course_axis or "").replace("_", " ")
        title = self.title.format(slow=result.counted, over=over).removesuffix(" (table)")
        if lacks := result.lacks(*self.needs):
            return Missing(self.name, title, lacks)
        shown = of_shown_scene(result, self.scene) if self.scene else result
        drawn = self._drawn(shown, WIDTH)
        if drawn is None:
            return None
        if isinstance(drawn, str):
            return Missing(self.name, title, drawn)
        named = {
            POINT: ("frequency", "scheme", *shown.varying, *shown.fixed),
            COURSE: (result.course_axis or "frequency",),
        }
        where = shown.describe(shown.shown_point(), named.get(self.at, ()))
        title = f"{title}: {where}" if where else title
        if isinstance(drawn, Table):
            return replace(drawn, name=self.name, title=title)
        return Drawing(self.name, title, drawn[1], drawn[0], lambda: cast("Any", self._drawn(shown, COLUMN_WIDTH))[0])

    def _drawn(self, result: Result, width: float) -> Drawn:
        # the style is that of the whole process: it is not left on while the caller has the word
        with style(width):
            return self.draw(result)


_ONE: dict[str, Any] = {"scene": OF_PAIRS, "at": POINT}
_BLOCK: dict[str, Any] = {"kinds": (MISSIONS,), "at": POINT}
_MODE: dict[str, Any] = {"kinds": (MODES,)}
_WEAR: dict[str, Any] = {"kinds": (WEAR,)}

FIGURES = (
    Entry("blocks", "Blocks of the mission with their wear (table)", missions.list_blocks, **_BLOCK),
    Entry("block_shares", "Wear by block over the missions", missions.draw_shares, **_BLOCK),
    Entry("block_responses", "Vibration of each block over the missions", missions.draw_responses, **_BLOCK),
    *(
        Entry(name, title, partial(response.draw_mode, name=name), needs=(name,), **_MODE)
        for name, title in (
            ("natural_frequency", "Natural frequency of a mode over its amplitude"),
            ("damping_ratio", "Damping ratio of a mode over its amplitude"),
        )
    ),
    Entry("worn_volume_bands", "Worn volume of the samples over {slow}", scatter.draw_bands),
    Entry("worn_volume_bands_course", "Worn volume of the samples over {over}", scatter.draw_bands_over_course),
    Entry("exceedance", "Probability of more wear", scatter.draw_exceedance),
    Entry("deciding_inputs", "What decides the worn volume", scatter.draw_deciding_inputs),
    Entry("deciding_input", "Worn volume over the input that decides most", scatter.draw_deciding_input),
    Entry("worn_volume", "Worn volume over {slow}", wear.draw_history, needs=("worn_volume",), at=COURSE),
    Entry("final_worn_volume", "Final worn volume over {over}", wear.draw_final, needs=("worn_volume",)),
    *(
        Entry(f"{name}_map", title, partial(wear.draw_map, name=name), needs=("worn_volume", name))
        for name, title in (
            ("worn_volume", "Worn volume over {over} and {slow}"),
            ("wear_rate", "Wear rate over {over} and {slow}"),
        )
    ),
    Entry(
        "frequency_response",
        "Frequency response of one joint, new and worn",
        response.draw_responses,
        **_WEAR,
        needs=("response_amplitude",),
    ),
    Entry(
        "response_after_own_wear",
        "Response of different joints, each after wear at its own frequency",
        response.draw_after_wear,
        **_WEAR,
        needs=("response_amplitude",),
    ),
    Entry(
        "excitation_frequency", "Frequency of an excitation that follows the resonance", wear.draw_excitation, **_WEAR
    ),
    Entry("trends", "Trends along the axes of the study", trends.draw_trends),
    Entry("worn_root", "The worn root", root.draw_root, **_ONE),
    Entry("whole_disk", "The whole disk", root.draw_disk, scene=OF_PAIRS),
    Entry("wear_depth", "Wear depth of each pair", contact.draw_depths, **_ONE),
    Entry("worn_profile", "Worn profile of the contact surfaces", contact.draw_profile, **_ONE),
    Entry("mean_pressure", "Mean pressure", contact.draw_pressure, **_WEAR, **_ONE, needs=("mean_pressure",)),
    Entry("fretting_loops", "Fretting loops", loops.draw_fretting, **_WEAR, **_ONE),
    Entry("normal_load", "Normal force through a period", loops.draw_normal, **_WEAR, **_ONE),
    Entry("pair_motion", "Motion of the pairs in the contact plane", loops.draw_motion, **_WEAR, **_ONE),
    *(
        Entry(
            f"{name}_fraction",
            title,
            partial(root.draw_fraction, name=f"{name}_fraction"),
            **_MODE,
            **_ONE,
            needs=(f"{name}_fraction",),
        )
        for name, title in (("slip", "Where the joint slips"), ("open", "Where the joint opens"))
    ),
    Entry(
        "pair_numbers", "Numbers of the contact pairs", contact.draw_numbers, (WEAR, MISSIONS, MODES), scene=OF_PAIRS
    ),
    Entry(
        "natural_frequencies",
        "Sector and its natural frequencies, joint stuck",
        sector.draw_sector,
        scene=sector.OF_SECTOR,
        always=True,
    ),
    Entry("outcome_map", "How the points ended", outcome.draw_outcomes, (WEAR, MISSIONS, MODES), always=True),
    Entry("certificates", "Certificates: how right the states are (table)", outcome.list_certificates),
    Entry("precision", "Error against run time", precision.draw_precision, **_WEAR),
)
"""The figures of all results."""


def draw_report(result: Result) -> Iterator[Item]:
    """Figures, tables, and sentences about what is missing: the results, then how far they are to be trusted."""
    kind = MODES if result.has_modes else WEAR if result.blocks is None else MISSIONS
    has_results = bool(result.held.any())
    for entry in FIGURES:
        if kind in entry.kinds and (has_results or entry.always):
            item = entry.make(result)
            if item is not None:
                yield item
    if not has_results:
        yield Missing("results", "Results", "No point was computed: the file holds no results to draw.")


def list_figures() -> str:
    """The table of figures for the page REPORT."""
    only: dict[tuple[str, ...], str] = {(MISSIONS,): f" ({MISSIONS})", (MODES,): f" ({MODES})"}
    named = ((entry, entry.title.format(slow="cycles", over="frequency")) for entry in FIGURES)
    rows = [f"| `{entry.name}` | {title}{only.get(entry.kinds, '')} |" for entry, title in named]
    return "\n".join(("| file | shows |", "|---|---|", *rows))
