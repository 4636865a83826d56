"""The table of figures: all figures and tables of the report, in the order of the page."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from studyrunner.report import drawing as plot
from studyrunner.report.drawing import Drawing, Drawn, Item, Missing, Table, as_sentences
from studyrunner.report.figures import pairs, points, precision, response, root, wear
from studyrunner.report.selection import course_axis
from studyrunner.result.pairs import OF_PAIRS, of_shown_scene
from studyrunner.result.view import Result

WEAR, MISSIONS, MODES = "wear histories", "missions", "nonlinear modes"
"""Kinds of results."""

_BANDS, _BARS = "Bands: estimated errors", "Bars: estimated errors, none where they are smaller than the markers"
_OTHERS = "Each value of the horizontal axis is a separate joint, which has worn at this value alone"
_QUANTILES = (
    "Line: half of the samples wear less. Bands: from 5 to 95 % and from 25 to 75 % of the samples, widened by the"
    " numerical errors"
)
CAPTIONS = {
    "blocks": "Cycles of one mission. A passage far below 1 in the last column wears as its steady vibrations do; f:"
    " frequency, zeta: damping ratio of the joint at rest",
    "block_shares": f"Above, shares of the blocks in the volume worn in one mission. {_BANDS}",
    "block_responses": f"Amplitude of the first harmonic in the mission that ends at the number. {_BANDS}",
    "natural_frequency": _BARS,
    "damping_ratio": _BARS,
    **{f"{name}_bands{over}": _QUANTILES for name in ("worn_volume", "wear_depth") for over in ("", "_course")},
    "exceedance": "Probability that more is worn than a volume, and that a pair is worn deeper than a depth. Where two"
    " lines are alike, samples without a value leave open what is between them",
    "deciding_inputs": "Share of the variance (Sobol' indices), or rank correlation: 1 or -1 where the volume rises or"
    " falls with this input alone; an effect that rises and falls is not seen",
    "worn_volume": _BANDS,
    "final_worn_volume": f"{_OTHERS}. Bars: estimated errors; of a point that ended early, what was worn by then",
    "worn_volume_map": f"{_OTHERS}. Hatched: no result",
    "wear_rate_map": f"{_OTHERS}. Hatched: no result",
    "excitation_frequency": _BANDS,
    "trends": "Bars: estimated errors",
    "wear_depth": "Of both surfaces together",
    "worn_profile": "Of both surfaces together",
    "fretting_loops": "Tangential force over relative displacement through a period, each about its mean: the area"
    " inside is the energy of friction",
    "normal_load": "Where the force is zero the pair is open",
    "pair_motion": "Path of the relative displacement about its mean; a pair that sticks is a dot",
    "certificates": "The largest over all points computed to the end and all counts in the file; 0 is the best",
    "precision": "Each mark is one setting; a line joins those of a scheme than which no quicker one is as exact;"
    " rings: of all. Open marks, in the grey: errors too small against the uncertainty of the reference",
}
"""How figures are to be read, whatever the result; what they say of a result stands before it."""


@dataclass(frozen=True)
class Entry:
    """One figure or table of the report.

    title: with {slow} for cycles or missions and {over} for the axis that figures are drawn over. of: what `draw` is
    given beside the result; of a table of variables all are needed. kinds: of results that have it. needs: variables
    without which a sentence says what to ask for. scene: variables of which the scene of the shown point is drawn. at:
    what the title names, the "point" that is shown or its "course". always: also where no point has a result.
    """

    name: str
    title: str
    draw: Callable[..., Drawn]
    of: Any = None
    kinds: tuple[str, ...] = (WEAR, MISSIONS)
    needs: tuple[str, ...] = ()
    scene: tuple[str, ...] = ()
    at: str = ""
    always: bool = False

    def make(self, result: Result, width: float = plot.WIDTH) -> Item | None:
        """The figure, a sentence in its place, or None. width: of the figure, inches."""
        axis, how = course_axis(result) or "", CAPTIONS.get(self.name, "")
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
        title = f"{title}: {where}" if where else title
        if isinstance(drawn, Table):
            return replace(drawn, name=self.name, title=title, note=as_sentences(drawn.note, how))
        figure, *notes = drawn
        return Drawing(self.name, title, as_sentences(*notes, how), figure)

    def _drawn(self, result: Result, width: float) -> Drawn:
        # the style is that of the whole process: the caller does not run with it
        with plot.style(width):
            drawn = self.draw(result) if self.of is None else self.draw(result, self.of)
            if isinstance(drawn, tuple) and not drawn[0].legends:
                plot.add_legend(drawn[0])
        return drawn


_ALL, _OF_MODES, _OF_WEAR, _OF_MISSIONS = (WEAR, MISSIONS, MODES), (MODES,), (WEAR,), (MISSIONS,)
_ONE: dict[str, Any] = {"scene": OF_PAIRS, "at": "point"}
_BLOCK: dict[str, Any] = {"kinds": _OF_MISSIONS, "at": "point"}
_LOOPS: dict[str, Any] = {"kinds": _OF_WEAR, **_ONE}
_RESPONSE: dict[str, Any] = {"kinds": _OF_WEAR, "needs": ("response_amplitude",)}
_SECTOR: dict[str, Any] = {"scene": root.OF_SECTOR, "always": True, "needs": ("natural_frequency",)}
_WORN = ("worn_volume",)


def _mode(draw: Callable[[Result, Any], Drawn], name: str, title: str, **options: Any) -> Entry:
    """A figure of the variable of modes of its name."""
    return Entry(name, title, draw, name, _OF_MODES, (name,), **options)


FIGURES = (
    Entry("blocks", "Blocks of the mission with their wear", wear.list_blocks, needs=wear.LISTED, **_BLOCK),
    Entry("block_shares", "Wear by block over the missions", wear.draw_blocks, wear.SHARES, **_BLOCK),
    Entry("block_responses", "Vibration of each block over the missions", wear.draw_blocks, wear.RESPONSES, **_BLOCK),
    _mode(response.draw_mode, "natural_frequency", "Natural frequency of a mode over its amplitude"),
    _mode(response.draw_mode, "damping_ratio", "Damping ratio of a mode over its amplitude"),
    *(
        Entry(f"{name}_bands{end}", f"{words} of the samples over {over}", points.draw_bands, (name, way))
        for name, words in (("worn_volume", "Worn volume"), ("wear_depth", "Deepest wear"))
        for end, over, way in (("", "{slow}", "cycle"), ("_course", "{over}", "course"))
    ),
    Entry("exceedance", "Probability of more wear", points.draw_exceedance),
    Entry("deciding_inputs", "What decides the worn volume", points.draw_deciding_inputs),
    Entry("worn_volume", "Worn volume over {slow}", wear.draw_history, needs=_WORN, at="course"),
    Entry("final_worn_volume", "Final worn volume over {over}", wear.draw_final, needs=_WORN),
    Entry("worn_volume_map", "Worn volume over {over} and {slow}", wear.draw_map, "worn_volume", needs=_WORN),
    Entry("wear_rate_map", "Wear rate over {over} and {slow}", wear.draw_map, "wear_rate", needs=(*_WORN, "wear_rate")),
    Entry("frequency_response", "Frequency response of one joint, new and worn", response.draw_responses, **_RESPONSE),
    Entry("excitation_frequency", "Frequency of the followed resonance", wear.draw_excitation, kinds=_OF_WEAR),
    Entry("trends", "Trends along the axes of the study", points.draw_trends),
    Entry("points", "Points of the design (table)", points.list_points, always=True),
    Entry("worn_root", "The worn root", root.draw_root, **_ONE),
    Entry("wear_depth", "Wear depth of each pair", pairs.draw_depths, **_ONE),
    Entry("worn_profile", "Worn profile of the contact surfaces", pairs.draw_profile, **_ONE),
    Entry("mean_pressure", "Mean pressure", pairs.draw_pressure, needs=("mean_pressure",), **_LOOPS),
    Entry("fretting_loops", "Fretting loops", response.draw_loops, "fretting_loops", **_LOOPS),
    Entry("normal_load", "Normal force through a period", response.draw_loops, "normal_load", **_LOOPS),
    Entry("pair_motion", "Motion of the pairs in the contact plane", response.draw_loops, "pair_motion", **_LOOPS),
    _mode(root.draw_fraction, "slip_fraction", "Where the joint slips", **_ONE),
    _mode(root.draw_fraction, "open_fraction", "Where the joint opens", **_ONE),
    Entry("pair_numbers", "Numbers of the contact pairs", pairs.draw_numbers, scene=OF_PAIRS, kinds=_ALL),
    Entry("natural_frequencies", "Sector and its natural frequencies, joint stuck", root.draw_sector, **_SECTOR),
    Entry("outcome_map", "How the points ended", points.draw_outcomes, always=True, kinds=_ALL),
    Entry("certificates", "Certificates: how right the states are", points.list_certificates),
    Entry("precision", "Error against run time", precision.draw_precision, kinds=_OF_WEAR),
)
"""The figures of all results."""


def draw_report(result: Result, width: float = plot.WIDTH) -> Iterator[Item]:
    """Figures, tables, and sentences about what is missing: the results, then how far they are to be trusted.

    width: of the figures, inches.
    """
    kind = result.kind.words
    has_results = bool(result.has_values.any())
    for entry in FIGURES:
        if kind in entry.kinds and (has_results or entry.always):
            item = entry.make(result, width)
            if item is not None:
                yield item
    if not has_results:
        yield Missing("results", "Results", "No point was computed: the file holds no results to draw.")
