"""The table of figures: what a figure or table of the report is, those of several kinds of results, and the report."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from studyrunner.kinds.table import KINDS
from studyrunner.report import drawing as plot
from studyrunner.report.drawing import Drawing, Drawn, Item, Missing, Table, as_sentences
from studyrunner.report.figures import measured, pairs, points, root, samples, sectors, wear
from studyrunner.report.selection import course_axis
from studyrunner.result.pairs import OF_PAIRS, of_shown_scene
from studyrunner.result.view import Result


@dataclass(frozen=True)
class Entry:
    """One figure or table of the report.

    title: with {slow} for cycles or missions and {over} for the axis that figures are drawn over. of: what `draw` is
    given beside the result; of a table of variables all are needed. needs: variables without which a sentence says
    what to ask for. scene: variables of which the scene of the shown point is drawn. at: what the title names, the
    "point" that is shown or its "course". always: also where no point has a result. caption: how it is to be read,
    whatever the result; what it says of a result stands before it.
    """

    name: str
    title: str
    draw: Callable[..., Drawn]
    of: Any = None
    needs: tuple[str, ...] = ()
    scene: tuple[str, ...] = ()
    at: str = ""
    always: bool = False
    caption: str = ""

    def make(self, result: Result, width: float = plot.WIDTH) -> Item | None:
        """The figure, a sentence in its place, or None. width: of the figure, inches."""
        axis = course_axis(result) or ""
        title = self.title.format(slow=result.counted, over=axis.replace("_", " "))
        shown = of_shown_scene(result, self.scene) if self.scene else result
        needs = (*self.needs, *(self.of if isinstance(self.of, dict) else ()))
        drawn = result.lacks(*needs) or self._drawn(shown, width)
        if drawn is None:
            return None
        if isinstance(drawn, str):
            return Missing(self.name, title, as_sentences(drawn))
        named = {"point": ("frequency", "scheme", *shown.varying, *shown.fixed), "course": (axis or "frequency",)}
        where = shown.describe(shown.shown, named.get(self.at, ()))
        if "contact_sector" in self.scene and shown.has("contact_sector"):
            where = ", ".join(filter(None, (where, f"sector {int(shown.dataset['contact_sector'][0])}")))
        title = f"{title}: {where}" if where else title
        if isinstance(drawn, Table):
            return replace(drawn, name=self.name, title=title, note=as_sentences(drawn.note, self.caption))
        figure, *notes = drawn
        return Drawing(self.name, title, as_sentences(*notes, self.caption), figure)

    def _drawn(self, result: Result, width: float) -> Drawn:
        # the style is that of the whole process: the caller does not run with it
        with plot.style(width):
            drawn = self.draw(result) if self.of is None else self.draw(result, self.of)
            if isinstance(drawn, tuple) and not drawn[0].legends:
                plot.add_legend(drawn[0])
        return drawn


BANDS, BARS = "Bands: estimated errors", "Bars: estimated errors, none where they are smaller than the markers"
ONE: dict[str, Any] = {"scene": OF_PAIRS, "at": "point"}
"""Options of a figure of the pairs at the shown point."""

_OTHERS = "Each value of the horizontal axis is a separate joint, which has worn at this value alone"
_WORN, _BOTH = ("worn_volume",), "Of both surfaces together"
_MAP: dict[str, Any] = {"needs": _WORN, "caption": f"{_OTHERS}. Hatched: no result"}
_RATE: dict[str, Any] = {"needs": (*_WORN, "wear_rate")}
_QUANTILES = (
    "Line: half of the samples wear less. Bands: from 5 to 95 % and from 25 to 75 % of the samples, widened by the"
    " numerical errors"
)
_EXCEEDANCE = (
    "Probability that more is worn than a volume, and that a pair is worn deeper than a depth; that a response is"
    " larger, or a life longer, where these have a limit. Where two lines are alike, samples without a value leave open"
    " what is between them"
)
_DECIDING = (
    "Share of the variance (Sobol' indices), or rank correlation: 1 or -1 where the volume, or the life, rises or falls"
    " with this input alone; an effect that rises and falls is not seen"
)
_ENDS = f"{_OTHERS}. Bars: estimated errors; of a point that ended early, what was worn by then"
_CERTIFIED = "The largest over all points computed to the end and all counts in the file; 0 is the best"
_SECTOR: dict[str, Any] = {"scene": root.OF_SECTOR, "always": True, "needs": ("natural_frequency",)}

OF_WEAR = (
    *(
        Entry(
            f"{name}_bands{end}",
            f"{of} of the samples over {over}",
            samples.draw_bands,
            (name, way),
            caption=_QUANTILES,
        )
        for name, of in (("worn_volume", "Worn volume"), ("wear_depth", "Deepest wear"))
        for end, over, way in (("", "{slow}", "cycle"), ("_course", "{over}", "course"))
    ),
    Entry("exceedance", "Probability of more", samples.draw_exceedance, caption=_EXCEEDANCE),
    Entry("deciding_inputs", "What decides", samples.draw_deciding_inputs, caption=_DECIDING),
    Entry("worn_volume", "Worn volume over {slow}", wear.draw_history, needs=_WORN, at="course", caption=BANDS),
    Entry("final_worn_volume", "Final worn volume over {over}", wear.draw_final, needs=_WORN, caption=_ENDS),
    Entry("worn_volume_map", "Worn volume over {over} and {slow}", wear.draw_map, "worn_volume", **_MAP),
    Entry("wear_rate_map", "Wear rate over {over} and {slow}", wear.draw_map, "wear_rate", **_MAP | _RATE),
)
"""Of results with a slow time: what wears."""

OF_RINGS = (
    Entry("sector_amplitude_map", "Amplitude over sectors and {over}", sectors.draw_amplitudes, caption=_OTHERS),
    Entry("sectors", "Sectors of the ring", sectors.draw_sectors, at="point"),
    Entry("magnification", "Largest amplitude over the mean of all sectors", sectors.draw_magnification),
)
"""Of rings with all sectors."""

OF_POINTS = (
    Entry("trends", "Trends along the axes of the study", points.draw_trends, caption="Bars: estimated errors"),
    Entry("points", "Points of the design (table)", points.list_points, always=True),
    Entry("worn_root", "The worn root", root.draw_root, **ONE),
    Entry("wear_depth", "Wear depth of each pair", pairs.draw_depths, caption=_BOTH, **ONE),
    Entry("worn_profile", "Worn profile of the contact surfaces", pairs.draw_profile, caption=_BOTH, **ONE),
)
"""Of results with a slow time: points and pairs."""

_MEASURED = "Bars: standard deviations of what was measured. Bands: numerical errors, of samples from 5 to 95 %"
OF_MEASURED = (
    Entry("measured", "Computed and measured", measured.draw_measured, caption=_MEASURED),
    Entry("identified", "Inputs, as drawn and with what was measured", measured.draw_identified),
)
"""Of results with [measured]."""

NUMBERS = Entry("pair_numbers", "Numbers of the contact pairs", pairs.draw_numbers, scene=OF_PAIRS)
OUTCOMES = Entry("outcome_map", "How the points ended", points.draw_outcomes, always=True)
"""Of all results."""

AT_THE_END = (
    NUMBERS,
    Entry("natural_frequencies", "Sector and its natural frequencies, joint stuck", root.draw_sector, **_SECTOR),
    OUTCOMES,
    Entry("certificates", "Certificates: how right the states are", points.list_certificates, caption=_CERTIFIED),
)
"""Of results with a slow time: scene and outcomes."""


def all_figures() -> tuple[Entry, ...]:
    """The figures of all results, of each kind in the order of its page."""
    found = {entry.name: entry for kind in KINDS.values() for entry in kind.part("figures").FIGURES}
    return tuple(found.values())


def draw_report(result: Result, width: float = plot.WIDTH) -> Iterator[Item]:
    """Figures, tables, and sentences about what is missing: the results, then how far they are to be trusted.

    width: of the figures, inches.
    """
    has_results = bool(result.has_values.any())
    figures: tuple[Entry, ...] = result.kind.part("figures").FIGURES
    for item in (entry.make(result, width) for entry in figures if has_results or entry.always):
        if item is not None:
            yield item
    if not has_results:
        yield Missing("results", "Results", "No point was computed: the file holds no results to draw.")
