"""Figures of the contact pairs: what is drawn are the numbers of the file, each at its place."""

import numpy as np
import pytest
from matplotlib.collections import QuadMesh

from studyrunner.report.drawing import Drawing
from studyrunner.report.page_contents import draw_report
from tests.studyrunner.report.figure_cases import make_result, with_loops, with_variables
from tests.studyrunner.report.figure_numbers import cells_of, draw_figure, lines_of, values_of


def test_wear_depth_of_each_pair():
    result = make_result()
    lines = lines_of(draw_figure(result, "wear_depth").figure.axes[0])
    for number, label in enumerate(("implicit scheme", "explicit scheme")):
        x, y = lines[label]
        np.testing.assert_allclose(np.round(x), np.arange(12))
        np.testing.assert_allclose(y, 1e6 * values_of(result, "wear_depth", frequency=2, scheme=number, cycle=-1))


def _by_position(result, values, pairs):
    """Values of a flank as (across, along): along grows with z, across goes down, where x falls."""
    x, z = result.dataset["contact_x"].values, result.dataset["contact_z"].values
    order = sorted(pairs, key=lambda pair: (-round(x[pair], 6), round(z[pair], 6)))
    return values[order].reshape(2, 3)


def test_pressure_on_both_flanks_at_the_first_and_the_last_cycle():
    result = make_result()
    panels = draw_figure(result, "mean_pressure").figure.axes[:4]
    titles = [panel.get_title() for panel in panels]
    assert titles == [
        "left, 0 cycles",
        "right, 0 cycles",
        "left, 20\N{NO-BREAK SPACE}000 cycles",
        "right, 20\N{NO-BREAK SPACE}000 cycles",
    ]
    for number, panel in enumerate(panels):
        pressure = 1e-6 * values_of(result, "mean_pressure", frequency=2, scheme=0, cycle=[0, -1][number // 2])
        pairs = range(6) if number % 2 == 0 else range(6, 12)
        np.testing.assert_allclose(cells_of(panel), _by_position(result, pressure, pairs))
        mesh = next(item for item in panel.collections if isinstance(item, QuadMesh))
        assert mesh.norm.vmin == 0.0
        np.testing.assert_allclose(
            mesh.norm.vmax, 1e-6 * result.dataset["mean_pressure"].isel(frequency=2, scheme=0, cycle=[0, -1]).max()
        )


def test_worn_profile():
    result = make_result()
    panels = draw_figure(result, "worn_profile").figure.axes
    depth = 1e6 * values_of(result, "wear_depth", frequency=2, scheme=0, cycle=-1)
    for number, pairs in enumerate((range(6), range(6, 12))):
        rows = _by_position(result, depth, pairs)
        np.testing.assert_allclose(cells_of(panels[number]), rows)
        for line, row in zip(panels[2 + number].get_lines(), rows, strict=True):
            np.testing.assert_allclose(line.get_ydata(), row)
            np.testing.assert_allclose(line.get_xdata(), [0.0, 10.0, 20.0], atol=1e-9)
        bottom, top = panels[2 + number].get_ylim()
        assert bottom > top


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
    drawing = draw_figure(result, name)
    assert [panel.get_title() for panel in drawing.figure.axes[:2]] == ["pair 0", "pair 11"]
    for panel, pair in zip(drawing.figure.axes[:2], (0, 11), strict=True):
        move = values_of(result, "loop_displacement", frequency=2, scheme=0, contact=pair)
        force = values_of(result, "loop_force", frequency=2, scheme=0, contact=pair)
        closed = [np.concatenate([array, array[:, :1]], axis=1) for array in (move, force)]
        x, y = take(*closed)
        for line, cycle in zip(panel.get_lines(), (0, -1), strict=True):
            np.testing.assert_allclose(line.get_xdata(), x[cycle], atol=1e-9)
            np.testing.assert_allclose(line.get_ydata(), y[cycle], atol=1e-9)
    if name == "normal_load":
        share = np.mean(values_of(result, "loop_force", frequency=2, scheme=0, contact=0)[0, :, 0] <= 0.0)
        assert f"pair 0 {100 * share:.0f} %" in drawing.caption


def test_only_the_most_worn_of_many_loops_are_shown():
    drawing = draw_figure(with_loops(make_result(), contacts=range(12)), "fretting_loops")
    assert [panel.get_title() for panel in drawing.figure.axes[:3]] == ["pair 9", "pair 10", "pair 11"]
    assert "pairs 0, 1, 2, 3, 4, 5, 6, 7, ..." in drawing.caption


@pytest.mark.slow
def test_a_pair_with_one_tangent_has_no_path():
    result = with_loops(make_result())
    only = result.dataset["loop_displacement"].where(result.dataset["component"] != "tangent_2")
    items = {item.name: item for item in draw_report(with_variables(result, loop_displacement=only))}
    assert "pair_motion" not in items
    loops = items["fretting_loops"]
    assert isinstance(loops, Drawing)
    assert len(loops.figure.axes) == 2
    assert loops.figure.axes[0].get_xlabel() == "displacement along\ntangent 1 (µm)"


def test_tangents_are_told_in_the_words_of_the_scene():
    """Names of the bundled scene are those of its page: first tangent axial, second along the flank."""
    first, second = "axial displacement (µm)", "displacement along the flank (µm)"
    result = with_loops(make_result())
    result.dataset.attrs["study"] = '[scene]\nmodel = "dovetail_sector"\n'
    top, bottom = draw_figure(result, "fretting_loops").figure.axes[::2]
    assert top.get_xlabel().replace("\n", " ") == first
    assert bottom.get_xlabel().replace("\n", " ") == second
    assert top.get_ylabel().replace("\n", " ") == first.replace("displacement", "force").replace("µm", "N")
    motion = draw_figure(result, "pair_motion").figure.axes[0]
    assert [motion.get_xlabel().replace("\n", " "), motion.get_ylabel().replace("\n", " ")] == [first, second]
