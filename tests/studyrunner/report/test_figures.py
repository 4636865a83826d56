"""All figures together: which there are in each case, that none is empty, that axes have units."""

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr

from studyrunner.report.drawing import Drawing, Missing, Table
from studyrunner.report.page_contents import draw_report
from studyrunner.report.reading.result import Result
from tests.studyrunner.report.figure_cases import (
    make_result,
    with_loops,
    with_sector,
    with_two_responses,
    with_variables,
)
from tests.studyrunner.report.figure_numbers import draw_figure

ALL_DRAWINGS = (
    "natural_frequencies frequency_response worn_volume worn_volume_map wear_rate_map final_worn_volume worn_root"
    " pair_numbers wear_depth worn_profile mean_pressure fretting_loops normal_load pair_motion estimated_errors"
)


WITHOUT_UNITS = {"contact pair", "nodal diameter", "estimated relative error", "scheme", "sweep", ""}


def _complete():
    return with_sector(with_loops(make_result()))


def _names(items, kind):
    return [item.name for item in items if isinstance(item, kind)]


CASES = {
    "complete": _complete,
    "one point": lambda: make_result(frequency=[200.0], scheme=["implicit"]),
    "no cycles": lambda: make_result(cycles=[0.0]),
    "all failed": lambda: make_result(failed=range(8)),
    "nothing wears": lambda: make_result(wears=False),
    "scattered pairs": lambda: make_result(pairs="scattered"),
    "pairs nowhere": lambda: make_result(pairs="nowhere"),
    "wear coefficients at one frequency": lambda: make_result(
        frequency=[200.0], wear_coefficient=[1e-12, 1e-11, 1e-10]
    ),
    "many combinations": lambda: make_result(wear_coefficient=np.geomspace(1e-12, 1e-10, 7), sweep=["up", "down"]),
    "loops where some failed": lambda: with_loops(make_result(failed=[0, 5])),
    "two responses": lambda: with_two_responses(make_result()),
    "nothing asked for": lambda: make_result(
        without=[
            *("worn_volume", "wear_rate", "wear_depth", "mean_pressure", "response_amplitude", "response_phase"),
            *("response_error", "wear_rate_error", "energy_error", "stable"),
        ]
    ),
}


ABSENT = {
    "one point": {"frequency_response", "worn_volume_map", "final_worn_volume", "outcome_map", "estimated_errors"},
    "no cycles": {"worn_volume", "worn_volume_map", "wear_depth", "worn_profile"},
    "nothing wears": {"worn_volume_map", "final_worn_volume", "wear_depth", "worn_profile"},
    "pairs nowhere": {"worn_profile"},
    "all failed": set(ALL_DRAWINGS.split()),
}
"""What is not drawn, as there is nothing to see."""

# Laying out takes most of the time: done where the panels are others than elsewhere.
LAID_OUT = {"scattered pairs", "two responses"}


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_no_figure_is_empty_and_all_axes_have_units(case):
    items = list(draw_report(CASES[case]()))
    names = [item.name for item in items]
    assert len(set(names)) == len(names)
    assert not ABSENT.get(case, set()) & set(_names(items, Drawing))
    if case == "complete":
        assert (" ".join(_names(items, Drawing)), _names(items, Missing)) == (ALL_DRAWINGS, [])
    for item in items:
        assert item.title
        if isinstance(item, Drawing):
            assert item.caption.endswith(".")
            assert "nan" not in item.caption
            if case in LAID_OUT:
                item.figure.draw_without_rendering()
            if not item.name.startswith("precision"):
                _check_panels(item)
        elif isinstance(item, Missing):
            assert item.sentence.endswith(".")
        else:
            assert item.rows
            assert all(len(row) == len(item.columns) for row in item.rows)


def _check_panels(drawing):
    assert drawing.figure.axes
    for panel in drawing.figure.axes:
        values = [np.ma.masked_invalid(line.get_ydata()).compressed() for line in panel.get_lines()]
        values += [
            np.ma.masked_invalid(collection.get_array()).compressed()
            for collection in panel.collections
            if collection.get_array() is not None
        ]
        assert any(array.size for array in values), f"{drawing.name}: an empty panel"
        for axis in (panel.xaxis, panel.yaxis):
            label = axis.get_label_text().replace("\n", " ")
            assert label.endswith(")") or label in WITHOUT_UNITS, label


def test_what_is_missing_says_which_output_to_ask_for():
    items = list(draw_report(CASES["nothing asked for"]()))
    sentences = {item.name: item.sentence for item in items if isinstance(item, Missing)}
    for name in ("worn_volume", "frequency_response", "mean_pressure", "wear_depth"):
        variable = "response_amplitude" if name == "frequency_response" else name
        assert sentences[name] == f"Add {variable} to [outputs] variables."
    assert "loops = [0]" in sentences["fretting_loops"]
    assert sentences["natural_frequencies"].startswith("Add natural_frequency and mesh to [outputs] variables.")


def test_all_points_failed():
    items = list(draw_report(CASES["all failed"]()))
    assert _names(items, Drawing) == ["outcome_map"]
    assert "results" in _names(items, Missing)
    table = next(item for item in items if item.name == "outcomes")
    assert isinstance(table, Table)
    assert table.rows == (("3", "branch lost", "8", "The branch was lost.", "200 Hz, implicit scheme"),)


def _pixels(path):
    """Width of a picture."""
    header = path.read_bytes()[:24]
    assert header.startswith(b"\x89PNG")
    return int.from_bytes(header[16:20])


@pytest.mark.slow
def test_figures_are_saved_as_svg_and_png_those_of_one_panel_for_a_column_too(tmp_path):
    before = dict(mpl.rcParams)
    drawings = {item.name: item for item in draw_report(make_result()) if isinstance(item, Drawing)}
    # one in three dimensions is in the tests of the root; saving takes long
    for name, fits in (("final_worn_volume", True), ("worn_volume_map", False)):
        assert drawings[name].fits_column == fits
        svg, png = drawings[name].save(tmp_path)
        content = svg.read_bytes()
        assert content.rstrip().endswith(b"</svg>")
        assert len(content) < 200_000
        assert _pixels(png) == 2250  # 190 mm at 300 dpi
        assert draw_figure(make_result(), name).save(tmp_path)[0].read_bytes() == content
    assert _pixels(tmp_path / "final_worn_volume_column.png") == 1065  # 90 mm at 300 dpi
    names = ("final_worn_volume", "final_worn_volume_column", "worn_volume_map")
    assert {path.name for path in tmp_path.iterdir()} == {f"{name}.{kind}" for name in names for kind in ("svg", "png")}
    assert dict(mpl.rcParams) == before


def test_variables_are_read_no_more_than_needed(tmp_path):
    path = tmp_path / "made.nc"
    make_result().dataset.to_netcdf(path)
    with xr.open_dataset(path) as dataset:
        list(draw_report(Result(path, dataset)))
        # Values of the pairs are read for the points shown; what is small is kept.
        assert not dataset["wear_depth"].variable._in_memory
        assert not dataset["mean_pressure"].variable._in_memory
        assert dataset["worn_volume"].variable._in_memory


@pytest.mark.slow
def test_an_exact_answer_is_drawn_beside_the_computed_one():
    result = make_result()
    exact = 1.02 * result.dataset["worn_volume"]
    amplitude = 1.01 * result.dataset["response_amplitude"]
    items = list(draw_report(with_variables(result, exact_worn_volume=exact, exact_response_amplitude=amplitude)))
    for name in ("worn_volume", "frequency_response"):
        drawing = next(item for item in items if item.name == name)
        assert isinstance(drawing, Drawing)
        assert "exact" in [line.get_label() for line in drawing.figure.axes[0].get_lines()]
