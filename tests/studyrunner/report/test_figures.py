"""The figures: which there are of each kind of result, that they can be read, and show the numbers of the file.

The numbers are those of the table (CSV) that is written beside each figure from what its artists hold.
"""

from dataclasses import replace
from itertools import product
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.collections import LineCollection, PolyCollection, QuadMesh

from studies.scene import SurfaceMesh
from studyrunner.report.contents import draw_report
from studyrunner.report.drawing import COLUMN_WIDTH, WIDTH, Drawing, Missing
from studyrunner.result.pairs import find_flanks
from studyrunner.result.view import Result
from studyrunner.study.study_file import read_study
from tests.studyrunner.report.cases import check_print, dovetail_file, draw_figure, numbers_of, values_of, with_mesh
from tests.studyrunner.report.test_precision import finest_file
from tests.studyrunner.results import SCATTER, fail, result_of_study, sample_file, smooth_result

ALL_DRAWINGS = (
    "final_worn_volume worn_volume worn_volume_map wear_rate_map frequency_response wear_depth worn_profile"
    " mean_pressure fretting_loops normal_load pair_motion pair_numbers natural_frequencies"
)
NOTHING = (
    *("worn_volume", "wear_rate", "wear_depth", "mean_pressure", "response_amplitude", "response_phase"),
    *("response_error", "wear_rate_error", "energy_error"),
)
FLAT = "worn_volume_map final_worn_volume wear_depth worn_profile"
ALONG = "frequency_response worn_volume_map final_worn_volume outcome_map"


def with_sector(result):
    """The same file with a mesh of a cube of two parts and natural frequencies of three modes."""
    nodes = np.array([[x, y, z] for x in (0.2, 0.3) for y in (-0.05, 0.05) for z in (-0.02, 0.02)])
    quads = np.array([[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]])
    dataset = with_mesh(result.dataset, SurfaceMesh(nodes, quads, ("disk",) * 3 + ("blade",) * 3))
    modes = np.array([[200.0, 400.0, 900.0], [201.0, 500.0, 950.0], [202.0, 520.0, 980.0]])
    dataset = dataset.assign(natural_frequency=(("nodal_diameter", "mode"), modes))
    return Result(result.path, dataset.assign_coords(nodal_diameter=np.arange(3)))


def samples():
    return Result(Path("samples.nc"), sample_file())


MANY = {"wear_coefficient": [1e-12, 1.1e-11], "sweep": ["up", "down"], "failed": [3], "loops": (0, 11)}
WEARS = {"frequency": [200.0], "wear_coefficient": [1e-12, 1e-11, 1e-10]}
# of each result what is drawn, and what is not, as there is nothing to see
CASES = {
    "complete": (lambda: with_sector(smooth_result(loops=(0, 11))), ALL_DRAWINGS, ""),
    "one point": (lambda: smooth_result(frequency=[200.0], scheme=["implicit"]), "worn_volume", ALONG),
    "no cycles": (lambda: smooth_result(cycles=[0.0]), "", f"worn_volume {FLAT}"),
    "all failed": (lambda: smooth_result(failed=range(8)), "", ALL_DRAWINGS),
    "nothing wears": (lambda: smooth_result(wears=False), "worn_volume", FLAT),
    "scattered pairs": (lambda: smooth_result(pairs="scattered"), "worn_profile", ""),
    "pairs nowhere": (lambda: smooth_result(pairs="nowhere"), "wear_depth", "worn_profile pair_numbers"),
    "wear coefficients": (lambda: smooth_result(**WEARS), "trends", "frequency_response"),
    "many": (lambda: with_sector(smooth_result(**MANY)), "outcome_map trends", ""),
    "two responses": (lambda: smooth_result(responses=("tip", "root")), "frequency_response", ""),
    "nothing asked for": (lambda: smooth_result(without=NOTHING), "", "worn_volume frequency_response"),
    "samples": (samples, "worn_volume_bands wear_depth_bands wear_depth_bands_course exceedance deciding_inputs", ""),
    "settings": (lambda: finest_file(1e-4), "precision", ""),
}
ON_PAPER = ("many", "two responses", "samples", "settings")


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
def test_each_kind_of_result_has_its_figures_and_they_can_be_read(case):
    make, present, absent = CASES[case]
    result = make()
    items = list(draw_report(result))
    drawn = {item.name for item in items if isinstance(item, Drawing)}
    assert len({item.name for item in items}) == len(items)
    assert set(present.split()) <= drawn
    assert not set(absent.split()) & drawn
    for item in items:
        assert item.title
        if isinstance(item, Drawing):
            assert item.caption.endswith(".")
            assert "nan" not in item.caption
        elif isinstance(item, Missing):
            assert item.sentence.endswith(".")
        else:
            assert all(len(row) == len(item.columns) for row in item.rows)
    for width in (WIDTH, COLUMN_WIDTH) if case in ON_PAPER else ():
        for item in items if width == WIDTH else draw_report(result, width):
            if isinstance(item, Drawing):
                check_print(item.figure, width, item.name)


# --- numbers ---

LINES = {
    "worn_volume": ("worn_volume", 1e9, {"frequency": 2}),
    "final_worn_volume": ("worn_volume", 1e9, {"cycle": -1}),
    "wear_depth": ("wear_depth", 1e6, {"frequency": 2, "cycle": -1}),
}
LOOPS = {
    "fretting_loops": lambda move, force: (1e6 * move[..., 1], force[..., 1]),
    "normal_load": lambda _move, force: (np.broadcast_to(22.5 * np.arange(17), (4, 17)), force[..., 0]),
    "pair_motion": lambda move, _force: (1e6 * move[..., 1], 1e6 * move[..., 2]),
}


@pytest.mark.parametrize("name", LINES)
def test_each_scheme_has_a_line_with_the_numbers_of_the_file(name):
    variable, factor, place = LINES[name]
    result = smooth_result()
    drawn = [rows for series, rows in numbers_of(draw_figure(result, name)).items() if "scheme" in series]
    expected = result.dataset[variable].isel(place).squeeze(drop=True).transpose("scheme", ...)
    x = expected[expected.dims[-1]].values
    for rows, y in zip(drawn, factor * expected.values, strict=True):
        np.testing.assert_allclose(rows[: len(y), 1], y, rtol=1e-8)
        # marks of one pair stand beside each other
        np.testing.assert_allclose(rows[: len(y), 0] / rows[len(y) - 1, 0], x / x[-1], atol=0.02)


@pytest.mark.parametrize(("name", "factor"), [("worn_volume", 1e9), ("wear_rate", 1e12)])
def test_maps_over_frequency_and_cycles(name, factor):
    result = smooth_result(frequency=[204.0, 200.0, 202.0, 201.0], failed=[2])
    drawing = draw_figure(result, f"{name}_map")
    for number, rows in enumerate(numbers_of(drawing).values()):
        expected = factor * values_of(result, name, scheme=number)[[1, 3, 2, 0]].T
        np.testing.assert_allclose(rows[:, 2], expected.ravel(), rtol=1e-8)
    assert drawing.figure.axes[0].patch.get_hatch()


def grid_of(result, name, factor, pairs, cycle):
    """Values of a flank as (up, along): along grows with z, upwards x rises."""
    x, z = result.dataset["contact_x"].values, result.dataset["contact_z"].values
    order = sorted(pairs, key=lambda pair: (round(x[pair], 6), round(z[pair], 6)))
    return factor * values_of(result, name, frequency=2, scheme=0, cycle=cycle)[order].reshape(2, 3)


FLANKS = (range(6), range(6, 12))


def test_pressure_and_depth_of_the_pairs_are_maps_and_profiles():
    result = smooth_result()
    pressure = draw_figure(result, "mean_pressure")
    places = [(pairs, cycle) for cycle in (0, -1) for pairs in FLANKS]
    for rows, place in zip(numbers_of(pressure).values(), places, strict=True):
        expected = grid_of(result, "mean_pressure", 1e-6, *place)
        np.testing.assert_allclose(rows[:, 2], expected.ravel(), rtol=1e-8)
    largest = result.dataset["mean_pressure"].isel(frequency=2, scheme=0, cycle=[0, -1]).max()
    for panel in pressure.figure.axes[:4]:
        mesh = next(item for item in panel.collections if isinstance(item, QuadMesh))
        np.testing.assert_allclose([mesh.norm.vmin, mesh.norm.vmax], [0.0, 1e-6 * largest])
    profile = draw_figure(result, "worn_profile")
    maps = [rows for series, rows in numbers_of(profile).items() if series.endswith("map")]
    for rows, panel, pairs in zip(maps, profile.figure.axes[2:4], FLANKS, strict=True):
        expected = grid_of(result, "wear_depth", 1e6, pairs, -1)
        np.testing.assert_allclose(rows[:, 2], expected.ravel(), rtol=1e-8)
        for line, row in zip(panel.get_lines(), expected, strict=True):
            np.testing.assert_allclose(line.get_data(), [[0.0, 20.0, 40.0], row], atol=1e-9)
        assert panel.yaxis_inverted()


@pytest.mark.parametrize("name", LOOPS)
def test_loops_are_closed_and_those_of_the_file(name):
    result = smooth_result(loops=(0, 11))
    found = numbers_of(draw_figure(result, name))
    for pair in (0, 11):
        of_pair = [
            values_of(result, of, frequency=2, scheme=0, contact=pair) for of in ("loop_displacement", "loop_force")
        ]
        x, y = LOOPS[name](*(np.concatenate([array, array[:, :1]], axis=1) for array in of_pair))
        for label, cycle in (("0 cycles", 0), ("20 000 cycles", -1)):
            np.testing.assert_allclose(found[f"pair {pair}|{label}"][:, :2].T, [x[cycle], y[cycle]], atol=1e-7)


def test_worn_volume_has_a_band_of_its_error_and_a_mark_where_it_ended_early():
    result = smooth_result()
    fail(result.dataset, 5, 3, 6000.0)
    drawing = draw_figure(result, "worn_volume")
    worn = 1e9 * values_of(result, "worn_volume", frequency=2)
    np.testing.assert_allclose(numbers_of(drawing)["|ended early"][0, :2], [5.0, worn[1, 2]], rtol=1e-8)
    band = next(found for found in drawing.figure.axes[0].collections if found.get_gid() == "error")
    highest = worn[0, -1] * (1.0 + values_of(result, "worn_volume_error", frequency=2, scheme=0)[-1])
    assert band.get_paths()[0].vertices[:, 1].max() == pytest.approx(highest)


def test_final_volumes_have_bars_and_marks():
    # numbers of points: frequency 200, 201, 202, 204 times implicit, explicit; errors 2 % at 202 Hz, 1.3 % beside it
    result = smooth_result(failed=[7])
    for point, outcome, last in ((2, 3, 6000.0), (4, 6, 20_000.0), (5, 15, 20_000.0)):
        fail(result.dataset, point, outcome, last)
    drawing = draw_figure(result, "final_worn_volume")
    found = numbers_of(drawing)
    marked = {"above rtol": [202.0, 204.0, 201.0], "sensitive": [202.0], "no result": [204.0]}
    assert {label: found[f"|{label}"][:, 0].tolist() for label in marked} == marked
    # what was worn by the last count before it ended
    early = 1e9 * values_of(result, "worn_volume", frequency=1, scheme=0)[2]
    np.testing.assert_allclose(found["|ended early"][:, :2], [[201.0, early]], rtol=1e-8)
    (bars, _) = [found for found in drawing.figure.axes[0].collections if isinstance(found, LineCollection)]
    worn = 1e9 * values_of(result, "worn_volume", frequency=2, scheme=0)[-1]
    (bar,) = [segment for segment in bars.get_segments() if segment[0, 0] == 202.0]
    np.testing.assert_allclose(bar[:, 1], [0.98 * worn, 1.02 * worn])


def test_frequency_response_of_both_sweeps_is_open_at_the_fold():
    result = smooth_result(sweep=["up", "down"], scheme=["implicit"])
    result.dataset["branch"][2:, ..., 0] = 1
    lines = numbers_of(draw_figure(result, "frequency_response"))
    for number, sweep in enumerate(("up", "down")):
        x, y, _ = lines[f"|sweep {sweep}, new joint"].T
        known = np.isfinite(y)
        expected = 1e3 * values_of(result, "response_amplitude", sweep=number, cycle=0)
        np.testing.assert_allclose([x[known], y[known]], [result.dataset["frequency"].values, expected], rtol=1e-8)
        assert np.flatnonzero(~known).tolist() == ([2] if number == 0 else [])


def test_worn_joints_have_response_curves():
    made = smooth_result(scheme=["implicit"], wear_coefficient=[0.0, 1e5])
    worn = Result(made.path, made.dataset.rename(wear_coefficient="worn_cycle"))
    lines = numbers_of(draw_figure(worn, "frequency_response"))
    for number, label in enumerate(("|worn cycle 0 1/Pa", "|worn cycle 100 000 1/Pa")):
        expected = 1e3 * values_of(worn, "response_amplitude", worn_cycle=number, cycle=0)
        np.testing.assert_allclose(lines[label][:, 1], expected, rtol=1e-8)


def test_an_exact_answer_is_drawn_beside_the_computed_one():
    result = smooth_result()
    exact = {f"exact_{name}": 1.02 * result.dataset[name] for name in ("worn_volume", "response_amplitude")}
    changed = replace(result, dataset=result.dataset.assign(exact))
    for name in ("worn_volume", "frequency_response"):
        assert "|exact" in numbers_of(draw_figure(changed, name))


def test_natural_frequencies_and_mesh():
    result = with_sector(smooth_result())
    left, right = draw_figure(result, "natural_frequencies").figure.axes
    faces = next(item for item in left.collections if isinstance(item, PolyCollection))
    assert len(faces.get_paths()) == 6
    *modes, study = sorted(right.get_lines(), key=lambda line: line.get_label() == "this study")
    for line, mode in zip(modes, result.dataset["natural_frequency"].values.T, strict=True):
        np.testing.assert_allclose(line.get_data(), [[0, 1, 2], mode])
    np.testing.assert_allclose(study.get_data(), [[0, 0], [200.0, 204.0]])


def test_outcomes_are_words_and_the_worst_certificate_is_named_with_its_place():
    drawing = draw_figure(smooth_result(failed=[2, 5]), "outcome_map")
    assert numbers_of(drawing)["|map"][:, 2].reshape(2, 4).tolist() == [[0, 3, 0, 0], [0, 0, 3, 0]]
    assert [label.get_text() for label in drawing.figure.axes[0].get_xticklabels()] == ["200", "201", "202", "204"]
    assert [text.get_text() for text in drawing.figure.legends[0].get_texts()] == ["converged", "branch lost"]
    result = smooth_result()
    table = next(item for item in draw_report(result) if item.name == "certificates")
    (row,) = [row for row in table.rows if row[0].endswith("error of the response")]
    assert float(row[1]) == pytest.approx(float(result.dataset["response_error"].max()), rel=0.05)
    assert row[2].startswith("202 Hz")


@pytest.mark.parametrize("density", [1, 2])
def test_a_flank_is_as_large_as_it_is(density):
    """40 mm long and 7 mm high: pairs at its edges own a half or a quarter of a cell."""
    for flank in find_flanks(Result(Path("dovetail.nc"), dovetail_file(density))):
        for edges, length in zip(flank.edges, (0.04, 0.007), strict=True):
            np.testing.assert_allclose(edges[[0, -1]], [0.0, length], atol=1e-6)
        cells = np.outer(*(np.diff(edges) for edges in flank.edges[::-1]))
        np.testing.assert_allclose(cells, flank.area[flank.grid.pair], rtol=1e-3)


def test_the_most_worn_of_many_loops_are_shown_about_their_means_and_one_tangent_has_no_path():
    result = smooth_result(loops=range(12))
    # at the last count, along the first tangent
    result.dataset["loop_displacement"].values[..., -1, :, :, 1] += 3e-3
    drawing = draw_figure(result, "fretting_loops")
    assert [panel.get_title() for panel in drawing.figure.axes[:3]] == ["pair 9", "pair 10", "pair 11"]
    for line in drawing.figure.axes[0].lines[:2]:
        assert abs(np.mean(np.array(line.get_xdata())[:-1])) < 1e-9 * np.ptp(line.get_xdata())
    only = result.dataset["loop_displacement"].where(result.dataset["component"] != "tangent_2")
    changed = replace(result, dataset=result.dataset.assign(loop_displacement=only))
    assert "pair_motion" not in {item.name for item in draw_report(changed)}


def test_trends_are_those_of_the_file():
    result = smooth_result(wear_coefficient=(1e-12, 5e-12, 5e-11), sweep=("up", "down"))
    last, at = result.dataset.isel(cycle=-1), tuple(result.shown[name] for name in result.axes)
    panels = draw_figure(result, "trends").figure.axes
    for number, values in enumerate((last["worn_volume"].values, last["response_amplitude"].isel(response=0).values)):
        row = [panel for panel in panels if panel.get_subplotspec().rowspan.start == number]
        for panel, axis in zip(row, (0, 1, 4, 5), strict=True):
            own = values[(*at[:axis], slice(None), *at[axis + 1 :])]
            (drawn,) = [np.asarray(line.get_ydata(), float) for line in panel.get_lines() if line.get_marker() == "o"]
            np.testing.assert_allclose(drawn / drawn.max(), own / own.max(), rtol=1e-12)


def test_samples_are_those_of_the_file():
    result = samples()
    found = numbers_of(draw_figure(result, "worn_volume_bands"))["211.5 Hz|median"]
    expected = np.quantile(result.dataset["worn_volume"].values[0], 0.5, axis=0, method="inverted_cdf") * 1e9
    np.testing.assert_allclose(found[:, 1], expected, rtol=1e-8)
    limited = result.dataset.assign_attrs(study=SCATTER + "limits = {wear_depth = 2e-6}\n")
    found = numbers_of(draw_figure(Result(result.path, limited), "wear_depth_bands"))
    np.testing.assert_allclose(found["211.5 Hz|limit"][:, 1], 2.0)
    np.testing.assert_allclose(found["211.5 Hz|median"][:, 1], 10.0 * expected, rtol=1e-8)
    bars = draw_figure(result, "deciding_inputs").figure.axes[0]
    names = [text.get_text().replace("\n", " ") for text in bars.get_xticklabels()]
    assert names[int(np.argmax([patch.get_height() for patch in bars.patches]))] == "wear coefficient"


def test_a_followed_frequency_that_the_file_does_not_hold_is_asked_for():
    given = ("axes.frequency='resonance'", "loading.between=[180, 230]", "outputs.variables=['worn_volume']")
    items = list(draw_report(Result(Path("followed.nc"), result_of_study(read_study("sdof_slider", given)))))
    (missing,) = [item for item in items if item.name == "excitation_frequency"]
    assert "excitation_frequency" in missing.sentence


# --- files ---


@pytest.mark.slow
def test_figures_are_saved_as_svg_and_png_for_a_page_and_for_a_column(tmp_path):
    before = dict(mpl.rcParams)
    for name, width in product(("final_worn_volume", "worn_volume_map"), (WIDTH, COLUMN_WIDTH)):
        path = draw_figure(smooth_result(), name, width).save(tmp_path)
        content = path.read_bytes()
        assert len(content) < 200_000
        # at 300 dpi
        assert int.from_bytes(path.with_suffix(".png").read_bytes()[16:20]) == int(300.0 * width)
        assert draw_figure(smooth_result(), name, width).save(tmp_path).read_bytes() == content
    assert dict(mpl.rcParams) == before


def test_a_history_with_values_at_its_first_count_only_is_drawn_without_a_warning():
    """As of a point that is at its target before the second count."""
    result = smooth_result(frequency=[200.0], scheme=["implicit"])
    volume = result.dataset["worn_volume"]
    early = volume.where(result.dataset["cycle"] == result.dataset["cycle"][0])
    draw_figure(Result(result.path, result.dataset.assign(worn_volume=early)), "worn_volume")
