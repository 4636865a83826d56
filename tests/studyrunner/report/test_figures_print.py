"""Figures on paper: legends cover no curve, nothing is cut off or runs into its neighbour, all text can be read."""

from collections.abc import Callable
from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from studyrunner.report.drawing import COLUMN_WIDTH, WIDTH, Drawing, add_legend, new_panels, set_in_column, style
from studyrunner.report.page_contents import draw_report
from studyrunner.report.reading.result import Result
from tests.studyrunner.report.figure_cases import make_result, with_loops, with_sector
from tests.studyrunner.report.test_precision import finest_file

_LEAST_SIZE = 7.0
_THIN = 2.0
"""Pixels by which boxes of text may touch."""


CASES = {
    "many": lambda: with_sector(
        with_loops(make_result(wear_coefficient=[1e-12, 1.1e-11], sweep=["up", "down"], failed=[3]))
    ),
    "precision": lambda: finest_file(estimate=lambda _: 1e-4),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_nothing_is_covered_or_cut_off(case):
    result: Callable[[], Result] = CASES[case]
    drawings = [item for item in draw_report(result()) if isinstance(item, Drawing)]
    assert sum(bool(_legends(drawing)) for drawing in drawings) >= 3
    assert case == "precision" or sum(drawing.fits_column for drawing in drawings) >= 5
    for drawing, width_in_print in [*((one, WIDTH) for one in drawings), *((one, COLUMN_WIDTH) for one in drawings)]:
        figure = drawing.figure
        if width_in_print == COLUMN_WIDTH:
            if not drawing.fits_column:
                continue
            with style():
                set_in_column(figure)
        canvas = FigureCanvasAgg(figure)
        with style():
            figure.draw_without_rendering()
        renderer = canvas.get_renderer()
        inside = figure.get_tightbbox(renderer)
        width, height = figure.get_size_inches()
        assert width == width_in_print
        assert min(inside.x0, inside.y0, width - inside.x1, height - inside.y1) > -_THIN / figure.dpi, drawing.name
        boxes = [panel.get_window_extent(renderer) for panel in figure.axes]
        for legend in _legends(drawing):
            assert not any(_overlap(legend.get_window_extent(renderer), box) for box in boxes), drawing.name
        whole = [panel.get_tightbbox(renderer) for panel in figure.axes]
        for one, other in combinations([box for box in whole if box is not None], 2):
            assert not _overlap(one, other), drawing.name
        for text in figure.findobj(Text):
            assert not text.get_text() or text.get_fontsize() >= _LEAST_SIZE, (drawing.name, text.get_text())


def _legends(drawing):
    own = [panel.get_legend() for panel in drawing.figure.axes]
    return [*drawing.figure.legends, *(legend for legend in own if legend is not None)]


def _overlap(one, other):
    common = Bbox.intersection(one, other)
    return common is not None and bool(np.min(common.size) > _THIN)


def test_a_legend_names_each_label_once_and_its_figure_grows():
    with style():
        heights = []
        for long in ("", " of a name that is much longer than half of the figure is wide, and longer still"):
            figure, panels = new_panels(1, 2, 3.0)
            for panel in panels.flat:
                for number in range(3):
                    panel.plot([0, 1], [0, number], label=f"line {number}{long}")
            add_legend(figure)
            heights.append(figure.get_figheight())
            (legend,) = figure.legends
            assert [text.get_text() for text in legend.get_texts()] == [f"line {number}{long}" for number in range(3)]
        empty, _ = new_panels(1, 1, 3.0)
        add_legend(empty)
    assert 3.0 < heights[0] < heights[1]
    assert not empty.legends
