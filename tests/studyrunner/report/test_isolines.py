"""Isolines of maps: where they run, what is written at them, and that no label hides another line."""

import numpy as np
from matplotlib.colors import Normalize
from matplotlib.contour import ContourSet

from studyrunner.report.drawing import new_panels, style
from studyrunner.report.isolines import add_colour_bar, add_isolines, find_levels


def _contours(panel):
    return [one for one in panel.collections if isinstance(one, ContourSet)]


def test_lines_run_where_a_plane_has_their_level_and_tell_it():
    x, y = np.linspace(0.0, 10.0, 6), np.linspace(0.0, 4.0, 5)
    norm = Normalize(0.0, 10.0)
    with style():
        figure, panels = new_panels(1, 1, 3.0)
        panel = panels[0, 0]
        panel.set(xlim=(0.0, 10.0), ylim=(0.0, 4.0))
        add_isolines(panel, x, y, np.broadcast_to(x, (5, 6)), norm)
        add_colour_bar(figure, panels, norm, "height (mm)")
    (lines,) = _contours(panel)
    assert list(lines.levels) == find_levels(norm) == [2.0, 4.0, 6.0, 8.0]
    for level, path in zip(lines.levels, lines.get_paths(), strict=True):
        np.testing.assert_allclose(path.vertices[:, 0], level)
    assert {text.get_text(): round(text.get_position()[0]) for text in panel.texts} == {"2": 2, "4": 4, "6": 6, "8": 8}
    bar = figure.axes[-1]
    assert [text.get_text() for text in bar.get_yticklabels()] == ["0", "2", "4", "6", "8"]
    assert [float(line.get_ydata()[0]) for line in bar.get_lines()] == [2.0, 4.0, 6.0, 8.0]
