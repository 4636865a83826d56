"""What is drawn and listed of error against run time is what was measured."""

import math
from xml.etree import ElementTree

import numpy as np
import pytest

from studyrunner.report.drawing import Drawing, Missing, Table
from studyrunner.report.precision.comparison import study_precision
from studyrunner.report.precision.figures import draw_precision
from studyrunner.report.precision.findings import show_percent
from tests.studyrunner.report.synthetic import synthetic
from tests.studyrunner.report.test_precision import HARMONICS, STEPS, exact_file, finest_file, precision_of


def items_of(precision):
    items = list(draw_precision(precision))
    names = [item.name for item in items]
    assert len(set(names)) == len(names)
    for item in items:
        if isinstance(item, Table):
            assert item.rows
            assert all(len(row) == len(item.columns) for row in item.rows)
    return dict(zip(names, items, strict=True))


def test_every_setting_is_a_mark_and_a_row(tmp_path):
    precision = precision_of(finest_file(estimate=lambda _: 1e-4))
    items = items_of(precision)
    drawing = items["precision"]
    assert isinstance(drawing, Drawing)
    n_settings = (2 * len(STEPS) + 1) * len(HARMONICS) - 1
    panels = drawing.figure.axes
    assert len(panels) == 4
    assert [panel.get_title(loc="left") for panel in panels] == ["100 Hz", "", "200 Hz", ""]
    assert [panel.get_ylabel() for panel in panels[:2]] == [
        "error of final worn volume",
        "error of response at the end",
    ]
    for panel, point in zip((panels[0], panels[2]), precision.points, strict=True):
        marks = [line for line in panel.lines if line.get_linestyle() == "None" and line.get_markersize() < 10.0]
        drawn = sorted((float(line.get_xdata()[0]), float(line.get_ydata()[0])) for line in marks)
        assert len(drawn) == n_settings
        known = sorted(point.measured[["run_time", "volume"]].itertuples(index=False))
        np.testing.assert_allclose(drawn, known, rtol=1e-12)
        rings = [line for line in panel.lines if line.get_markersize() > 10.0]
        assert len(rings) == len(point.front("volume"))
        assert (panel.get_xscale(), panel.get_yscale()) == ("log", "log")
    for number, point in enumerate(precision.points, start=1):
        table = items[f"precision_settings_{number}"]
        assert isinstance(table, Table)
        assert table.columns[:3] == ("scheme", "step", "harmonics")
        assert [row[4] for row in table.rows] == list(map(show_percent, point.measured["volume"]))
    for path in drawing.save(tmp_path):
        assert path.stat().st_size > 1000
    ElementTree.parse(tmp_path / "precision.svg")


def test_marks_of_errors_that_are_not_resolved_are_hollow():
    precision = precision_of(finest_file(estimate=lambda _: 2e-3))
    drawing = items_of(precision)["precision"]
    assert isinstance(drawing, Drawing)
    marks = [
        line for line in drawing.figure.axes[0].lines if line.get_linestyle() == "None" and line.get_markersize() < 10
    ]
    hollow = [line for line in marks if line.get_markerfacecolor() == "white"]
    assert len(hollow) == sum(~precision.points[0].measured["volume_resolved"]) > 0
    assert "known to 0.2 %" in drawing.caption


def test_failed_points_are_told_and_listed():
    precision = precision_of(finest_file(outcome=lambda point: 4 * (point["scheme"] == "explicit")))
    items = items_of(precision)
    drawing, table = items["precision"], items["precision_settings_1"]
    assert isinstance(drawing, Drawing)
    assert isinstance(table, Table)
    assert f"{2 * len(STEPS) * len(HARMONICS)} failed results" in drawing.caption
    assert sum("march failed" in row[-1] for row in table.rows) == len(STEPS) * len(HARMONICS)


def test_recommendations_are_listed_for_each_point_and_all():
    table = items_of(precision_of(exact_file()))["precision_recommended"]
    assert isinstance(table, Table)
    assert [row[:2] for row in table.rows] == [
        (label, target) for label in ("100 Hz", "200 Hz", "all points") for target in ("5 %", "1 %", "0.1 %")
    ]


def test_settings_that_all_agree_are_one_sentence():
    precision = study_precision(synthetic({"step": STEPS}, lambda _: 0.0, lambda _: 1.0))
    assert precision is not None
    (item,) = draw_precision(precision)
    assert isinstance(item, Missing)


def test_one_response_less_is_one_panel_less():
    result = finest_file()
    lesser = type(result)(result.path, result.dataset.drop_vars("response_amplitude"))
    drawing = items_of(precision_of(lesser))["precision"]
    assert isinstance(drawing, Drawing)
    assert len(drawing.figure.axes) == 2


@pytest.mark.parametrize(
    ("value", "text"), [(0.05, "5 %"), (0.00123, "0.12 %"), (0.0, "0 %"), (1e-9, "1e-07 %"), (math.inf, "not known")]
)
def test_percent(value, text):
    assert show_percent(value) == text
