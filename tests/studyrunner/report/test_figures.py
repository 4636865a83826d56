"""The figures: which there are of each kind of result, that they can be read and show the numbers of the file."""

from itertools import combinations
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection, QuadMesh
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from studyrunner.report.contents import draw_report
from studyrunner.report.drawing import COLUMN_WIDTH, WIDTH, Drawing, Missing, fit_into_column, style
from studyrunner.report.figures.flanks import find_flanks
from studyrunner.result.view import Result
from tests.studyrunner.report.figure_numbers import cells_of, draw_figure, lines_of, values_of
from tests.studyrunner.report.root_cases import dovetail_file
from tests.studyrunner.report.test_precision import finest_file
from tests.studyrunner.results import (
    make_result,
    sample_file,
    with_endings,
    with_loops,
    with_sector,
    with_two_responses,
    with_variables,
)

ALL_DRAWINGS = (
    "final_worn_volume worn_volume worn_volume_map wear_rate_map frequency_response wear_depth worn_profile"
    " mean_pressure fretting_loops normal_load pair_motion pair_numbers natural_frequencies"
)
NOTHING = (
    *("worn_volume", "wear_rate", "wear_depth", "mean_pressure", "response_amplitude", "response_phase"),
    *("response_error", "wear_rate_error", "energy_error"),
)
FLAT = "worn_volume_map final_worn_volume wear_depth worn_profile"
SAMPLED = "worn_volume_bands worn_volume_bands_course exceedance deciding_inputs"
# of each result what is drawn, what is not, as there is nothing to see, and whether it is tried on paper
CASES = {
    "complete": (lambda: with_sector(with_loops(make_result())), ALL_DRAWINGS, "", False),
    "one point": (
        lambda: make_result(frequency=[200.0], scheme=["implicit"]),
        "worn_volume",
        "frequency_response worn_volume_map final_worn_volume outcome_map",
        False,
    ),
    "no cycles": (lambda: make_result(cycles=[0.0]), "", f"worn_volume {FLAT}", False),
    "all failed": (lambda: make_result(failed=range(8)), "", ALL_DRAWINGS, False),
    "nothing wears": (lambda: make_result(wears=False), "worn_volume", FLAT, False),
    "scattered pairs": (lambda: make_result(pairs="scattered"), "worn_profile", "", True),
    "pairs nowhere": (lambda: make_result(pairs="nowhere"), "wear_depth", "worn_profile pair_numbers", False),
    "wear coefficients": (
        lambda: make_result(frequency=[200.0], wear_coefficient=[1e-12, 1e-11, 1e-10]),
        "trends",
        "frequency_response",
        False,
    ),
    "many": (
        lambda: with_sector(
            with_loops(make_result(wear_coefficient=[1e-12, 1.1e-11], sweep=["up", "down"], failed=[3]))
        ),
        "outcome_map trends",
        "",
        True,
    ),
    "two responses": (lambda: with_two_responses(make_result()), "frequency_response", "", True),
    "nothing asked for": (lambda: make_result(without=NOTHING), "", "worn_volume frequency_response", False),
    "samples": (lambda: Result(Path("samples.nc"), sample_file()), SAMPLED, "", True),
    "settings": (lambda: finest_file(1e-4), "precision", "", True),
}
_THIN = 2.0
"""Pixels by which boxes of text may touch."""


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_each_kind_of_result_has_its_figures_and_they_can_be_read(case):
    make, present, absent, on_paper = CASES[case]
    items = list(draw_report(make()))
    drawn = {item.name for item in items if isinstance(item, Drawing)}
    assert len({item.name for item in items}) == len(items)
    assert set(present.split()) <= drawn
    assert not set(absent.split()) & drawn
    for item in items:
        assert item.title
        if isinstance(item, Drawing):
            assert item.caption.endswith(".")
            assert "nan" not in item.caption
            if on_paper:
                _check_print(item.figure, WIDTH, item.name)
                _check_print(item.narrow(), COLUMN_WIDTH, item.name)
        elif isinstance(item, Missing):
            assert item.sentence.endswith(".")
        else:
            assert all(len(row) == len(item.columns) for row in item.rows)


def _check_print(figure, width_in_print, name):
    """Legends cover no panel, nothing is cut off or runs into its neighbour, on a page and in a column."""
    if width_in_print == COLUMN_WIDTH:
        fit_into_column(figure)
    with style():
        canvas = FigureCanvasAgg(figure)
        figure.draw_without_rendering()
    renderer = canvas.get_renderer()
    inside = figure.get_tightbbox(renderer)
    width, height = figure.get_size_inches()
    assert width == width_in_print
    assert min(inside.x0, inside.y0, width - inside.x1, height - inside.y1) > -_THIN / figure.dpi, name
    whole = [panel.get_tightbbox(renderer) for panel in figure.axes]
    whole += [legend.get_window_extent(renderer) for legend in figure.legends]
    for one, other in combinations([box for box in whole if box is not None], 2):
        common = Bbox.intersection(one, other)
        assert common is None or np.min(common.size) <= _THIN, name
    assert all(text.get_fontsize() >= 7.0 for text in figure.findobj(Text) if text.get_text()), name


@pytest.mark.slow
def test_figures_are_saved_as_svg_and_png_for_a_page_and_for_a_column(tmp_path):
    before = dict(mpl.rcParams)
    for name in ("final_worn_volume", "worn_volume_map"):
        paths = draw_figure(make_result(), name).save(tmp_path)
        contents_of = [path.read_bytes() for path in paths]
        assert max(map(len, contents_of)) < 200_000
        # 190 mm and 90 mm at 300 dpi
        pngs = [path.with_suffix(".png").read_bytes() for path in paths]
        assert [int.from_bytes(png[16:20]) for png in pngs] == [2250, 1065]
        assert [path.read_bytes() for path in draw_figure(make_result(), name).save(tmp_path)] == contents_of
    assert dict(mpl.rcParams) == before


def test_variables_are_read_no_more_than_needed(tmp_path):
    path = tmp_path / "made.nc"
    make_result().dataset.to_netcdf(path)
    with xr.open_dataset(path) as dataset:
        list(draw_report(Result(path, dataset)))
        # Values of the pairs are read for the points shown; what is small is kept.
        assert not dataset["wear_depth"].variable._in_memory
        assert not dataset["mean_pressure"].variable._in_memory


def test_the_output_to_ask_for_is_named():
    items = draw_report(make_result(without=NOTHING))
    sentences = {item.name: item.sentence for item in items if isinstance(item, Missing)}
    asked = {"worn_volume": "worn_volume", "frequency_response": "response_amplitude", "fretting_loops": "loops = [0]"}
    assert all(word in sentences[name] for name, word in asked.items())


def test_worn_volume_over_cycles_with_its_error_and_its_end():
    result = with_endings(make_result(), {5: (3, 6000.0)}, {})
    panel = draw_figure(result, "worn_volume").figure.axes[0]
    lines = lines_of(panel)
    for number, label in enumerate(("implicit scheme", "explicit scheme")):
        worn = 1e9 * values_of(result, "worn_volume", frequency=2, scheme=number)
        np.testing.assert_allclose(lines[label], [[0.0, 1.0, 5.0, 20.0], worn])
    np.testing.assert_allclose(np.ravel(lines["ended early"]), [5.0, worn[2]])
    band = next(found for found in panel.collections if found.get_gid() == "error")
    error = values_of(result, "worn_volume_error", frequency=2, scheme=0)[-1]
    highest = 1e9 * values_of(result, "worn_volume", frequency=2, scheme=0)[-1] * (1.0 + error)
    assert band.get_paths()[0].vertices[:, 1].max() == pytest.approx(highest)


@pytest.mark.parametrize(("name", "factor"), [("worn_volume", 1e9), ("wear_rate", 1e12)])
def test_maps_over_frequency_and_cycles(name, factor):
    result = make_result(frequency=[204.0, 200.0, 202.0, 201.0], failed=[2])
    panels = draw_figure(result, f"{name}_map").figure.axes
    for number in (0, 1):
        expected = factor * values_of(result, name, scheme=number)[[1, 3, 2, 0]].T
        np.testing.assert_allclose(cells_of(panels[number]), expected)
    assert np.isnan(cells_of(panels[0])).all(axis=0).tolist() == [True, False, False, False]
    assert panels[0].patch.get_hatch()


def test_final_volumes_have_bars_and_marks():
    # flat indices: frequency 200, 201, 202, 204 times implicit, explicit; errors 2 % at 202 Hz, 1.3 % beside it
    endings = {2: (3, 6000.0), 4: (6, 20_000.0), 5: (15, 20_000.0)}
    result = with_endings(make_result(failed=[7]), endings, {})
    panel = draw_figure(result, "final_worn_volume").figure.axes[0]
    lines = lines_of(panel)
    marked = {"above rtol": [202.0, 204.0, 201.0], "sensitive": [202.0], "no result": [204.0]}
    assert {label: lines[label][0].tolist() for label in marked} == marked
    # what was worn by the last count before it ended
    early = 1e9 * values_of(result, "worn_volume", frequency=1, scheme=0)[2]
    np.testing.assert_allclose(lines["ended early"], [[201.0], [early]])
    (bars, _) = [found for found in panel.collections if isinstance(found, LineCollection)]
    worn = 1e9 * values_of(result, "worn_volume", frequency=2, scheme=0)[-1]
    (bar,) = [segment for segment in bars.get_segments() if segment[0, 0] == 202.0]
    np.testing.assert_allclose(bar[:, 1], [0.98 * worn, 1.02 * worn])


def test_frequency_response_of_both_sweeps_is_open_at_the_fold():
    result = make_result(sweep=["up", "down"], scheme=["implicit"])
    branch, fold = (result.dataset[name].copy() for name in ("branch", "fold_frequency"))
    branch[2:, ..., 0], fold[2, ..., 0] = 1, 201.4
    changed = with_variables(result, branch=branch, fold_frequency=fold)
    lines = lines_of(draw_figure(changed, "frequency_response").figure.axes[0])
    for number, sweep in enumerate(("up", "down")):
        x, y = lines[f"sweep {sweep}, new joint"]
        known = np.isfinite(y)
        expected = 1e3 * values_of(result, "response_amplitude", sweep=number, cycle=0)
        np.testing.assert_allclose([x[known], y[known]], [result.dataset["frequency"].values, expected])
        assert np.flatnonzero(~known).tolist() == ([2] if number == 0 else [])
    (fold,) = [line for label, line in lines.items() if label.startswith("fold, sweep up")]
    assert set(fold[0].tolist()) == {201.4}


def test_worn_joints_have_response_curves_and_joints_that_wore_differently_are_marks():
    made = make_result(scheme=["implicit"], wear_coefficient=[0.0, 1e5])
    worn = Result(made.path, made.dataset.rename(wear_coefficient="worn_cycle"))
    lines = lines_of(draw_figure(worn, "frequency_response").figure.axes[0])
    for number, label in enumerate(("worn cycle 0 1/Pa", "worn cycle 100\N{NO-BREAK SPACE}000 1/Pa")):
        expected = 1e3 * values_of(worn, "response_amplitude", worn_cycle=number, cycle=0)
        np.testing.assert_allclose(lines[label][1], expected)
    result = make_result()
    (own,) = [
        line
        for line in draw_figure(result, "response_after_own_wear").figure.axes[0].get_lines()
        if str(line.get_label()).startswith("implicit")
    ]
    assert own.get_linestyle() == "None"
    np.testing.assert_allclose(own.get_ydata(), 1e3 * values_of(result, "response_amplitude", scheme=0, cycle=-1))


def test_an_exact_answer_is_drawn_beside_the_computed_one():
    result = make_result()
    exact = 1.02 * result.dataset["worn_volume"]
    amplitude = 1.01 * result.dataset["response_amplitude"]
    changed = with_variables(result, exact_worn_volume=exact, exact_response_amplitude=amplitude)
    for name in ("worn_volume", "frequency_response"):
        assert "exact" in lines_of(draw_figure(changed, name).figure.axes[0])


def test_natural_frequencies_and_mesh():
    result = with_sector(make_result())
    left, right = draw_figure(result, "natural_frequencies").figure.axes
    faces = next(item for item in left.collections if isinstance(item, PolyCollection))
    assert len(faces.get_paths()) == 6
    modes = [line for line in right.get_lines() if line.get_label() != "this study"]
    for line, mode in zip(modes, result.dataset["natural_frequency"].values.T, strict=True):
        np.testing.assert_allclose(line.get_data(), [[0, 1, 2], mode])
    np.testing.assert_allclose(lines_of(right)["this study"], [[0, 0], [200.0, 204.0]])


def test_the_map_of_outcomes_speaks_words_and_the_worst_certificate_is_named_with_its_place():
    result = make_result(failed=[2, 5])
    drawing = draw_figure(result, "outcome_map")
    panel = drawing.figure.axes[0]
    np.testing.assert_array_equal(cells_of(panel), [[0, 3, 0, 0], [0, 0, 3, 0]])
    assert [label.get_text() for label in panel.get_xticklabels()] == ["200", "201", "202", "204"]
    assert [text.get_text() for text in drawing.figure.legends[0].get_texts()] == ["converged", "branch lost"]
    table = next(item for item in draw_report(make_result()) if item.name == "certificates")
    (row,) = [row for row in table.rows if row[0] == "estimated error of the response"]
    assert float(row[1]) == pytest.approx(float(make_result().dataset["response_error"].max()), rel=0.05)
    assert row[2].startswith("202 Hz")


def _by_position(result, values, pairs):
    """Values of a flank as (up, along): along grows with z, upwards x rises."""
    x, z = result.dataset["contact_x"].values, result.dataset["contact_z"].values
    order = sorted(pairs, key=lambda pair: (round(x[pair], 6), round(z[pair], 6)))
    return values[order].reshape(2, 3)


def test_depth_and_pressure_of_the_pairs():
    result = make_result()
    lines = lines_of(draw_figure(result, "wear_depth").figure.axes[0])
    for number, label in enumerate(("implicit scheme", "explicit scheme")):
        x, y = lines[label]
        np.testing.assert_allclose(np.round(x), np.arange(12))
        np.testing.assert_allclose(y, 1e6 * values_of(result, "wear_depth", frequency=2, scheme=number, cycle=-1))
    panels = draw_figure(result, "mean_pressure").figure.axes[:4]
    for number, panel in enumerate(panels):
        pressure = 1e-6 * values_of(result, "mean_pressure", frequency=2, scheme=0, cycle=[0, -1][number // 2])
        pairs = range(6) if number % 2 == 0 else range(6, 12)
        np.testing.assert_allclose(cells_of(panel), _by_position(result, pressure, pairs))
        mesh = next(item for item in panel.collections if isinstance(item, QuadMesh))
        largest = result.dataset["mean_pressure"].isel(frequency=2, scheme=0, cycle=[0, -1]).max()
        np.testing.assert_allclose([mesh.norm.vmin, mesh.norm.vmax], [0.0, 1e-6 * largest])
    panels = draw_figure(result, "worn_profile").figure.axes
    depth = 1e6 * values_of(result, "wear_depth", frequency=2, scheme=0, cycle=-1)
    for number, pairs in enumerate((range(6), range(6, 12))):
        rows = _by_position(result, depth, pairs)
        np.testing.assert_allclose(cells_of(panels[number]), rows)
        for line, row in zip(panels[2 + number].get_lines(), rows, strict=True):
            np.testing.assert_allclose(line.get_data(), [[0.0, 10.0, 20.0], row], atol=1e-9)
        assert panels[2 + number].yaxis_inverted()


@pytest.mark.parametrize("density", [1, 2])
def test_a_flank_is_as_large_as_it_is(density):
    """40 mm long and 7 mm high: pairs at its edges own a half or a quarter of a cell."""
    for flank in find_flanks(Result(Path("dovetail.nc"), dovetail_file(density))):
        assert flank.cells is not None
        np.testing.assert_allclose(flank.cells.x_edges[[0, -1]], [0.0, 0.04], atol=1e-6)
        np.testing.assert_allclose(flank.cells.y_edges[[0, -1]], [0.0, 0.007], atol=1e-6)
        cells = np.outer(np.diff(flank.cells.y_edges), np.diff(flank.cells.x_edges))
        np.testing.assert_allclose(cells, flank.area[flank.cells.pair], rtol=1e-3)


@pytest.mark.parametrize(
    ("name", "take"),
    [
        ("fretting_loops", lambda move, force: (1e6 * move[..., 1], force[..., 1])),
        ("normal_load", lambda _move, force: (np.broadcast_to(np.arange(17) * 22.5, (4, 17)), force[..., 0])),
        ("pair_motion", lambda move, _force: (1e6 * move[..., 1], 1e6 * move[..., 2])),
    ],
)
def test_loops_are_closed_and_those_of_the_file(name, take):
    result = with_loops(make_result())
    figure = draw_figure(result, name).figure
    for panel, pair in zip(figure.axes[:2], (0, 11), strict=True):
        assert panel.get_title() == f"pair {pair}"
        move = values_of(result, "loop_displacement", frequency=2, scheme=0, contact=pair)
        force = values_of(result, "loop_force", frequency=2, scheme=0, contact=pair)
        x, y = take(*(np.concatenate([array, array[:, :1]], axis=1) for array in (move, force)))
        for line, cycle in zip(panel.get_lines(), (0, -1), strict=True):
            np.testing.assert_allclose(line.get_data(), [x[cycle], y[cycle]], atol=1e-9)


def test_the_most_worn_of_many_loops_are_shown_and_one_tangent_has_no_path():
    result = with_loops(make_result(), contacts=range(12))
    titles = [panel.get_title() for panel in draw_figure(result, "fretting_loops").figure.axes[:3]]
    assert titles == ["pair 9", "pair 10", "pair 11"]
    only = result.dataset["loop_displacement"].where(result.dataset["component"] != "tangent_2")
    assert "pair_motion" not in {item.name for item in draw_report(with_variables(result, loop_displacement=only))}


def test_words_of_the_joint_are_the_same_in_maps_and_loops():
    result = with_loops(make_result())
    result.dataset.attrs["study"] = '[scene]\nmodel = "dovetail_sector"\n'
    profile = draw_figure(result, "worn_profile").figure.axes
    motion = draw_figure(result, "pair_motion").figure.axes[0]
    labels = (profile[2].get_xlabel(), motion.get_xlabel()), (profile[0].get_ylabel(), motion.get_ylabel())
    for both, word in zip(labels, ("axial", "up the flank"), strict=True):
        assert all(word in label.replace("\n", " ") for label in both)
    # the axes of the mesh, where the scene has no words
    assert draw_figure(make_result(), "worn_profile").figure.axes[2].get_xlabel() == "z (mm)"


def test_trends_are_those_of_the_file():
    result = make_result(wear_coefficient=(1e-12, 5e-12, 5e-11), sweep=("up", "down"))
    last, place = result.dataset.isel(cycle=-1), tuple(result.shown_point()[name] for name in result.axes)
    worn, largest = last["worn_volume"].values, last["response_amplitude"].isel(response=0).max("frequency").values
    panels = draw_figure(result, "trends").figure.axes
    rows = [[panel for panel in panels if panel.get_subplotspec().rowspan.start == row] for row in (0, 1)]
    for row, axes, values in ((rows[0], (0, 1, 4, 5), worn), (rows[1], (1, 4, 5), largest[None])):
        at = place if values is worn else (0, *place[1:])
        for panel, axis in zip(row, axes, strict=True):
            own = values[(*at[:axis], slice(None), *at[axis + 1 :])]
            (drawn,) = [np.asarray(line.get_ydata(), float) for line in panel.get_lines() if line.get_marker() == "o"]
            np.testing.assert_allclose(drawn / drawn.max(), own / own.max(), rtol=1e-12)


def test_samples_are_those_of_the_file():
    dataset = sample_file()
    result = Result(Path("samples.nc"), dataset)
    panel = draw_figure(result, "worn_volume_bands").figure.axes[0]
    (median,) = [line for line in panel.get_lines() if line.get_label() == "median"]
    expected = np.quantile(dataset["worn_volume"].values[0, 0], 0.5, axis=0, method="inverted_cdf") * 1e9
    np.testing.assert_allclose(median.get_ydata(), expected)
    bars = draw_figure(result, "deciding_inputs").figure.axes[0]
    names = [text.get_text().replace("\n", " ") for text in bars.get_xticklabels()]
    assert names[int(np.argmax([patch.get_height() for patch in bars.patches]))] == "wear coefficient"
