"""What is drawn are the numbers of the file: data of the artists against the dataset, picked by plain indexing."""

import re

import numpy as np
import pytest
from matplotlib.collections import PolyCollection

from tests.studyrunner.report.figure_cases import make_result, with_sector, with_variables
from tests.studyrunner.report.figure_numbers import cells_of, draw_figure, find_table, lines_of, values_of


def test_worn_volume_over_cycles():
    result = make_result()
    drawing = draw_figure(result, "worn_volume")
    lines = lines_of(drawing.figure.axes[0])
    for number, label in enumerate(("implicit scheme", "explicit scheme")):
        x, y = lines[label]
        np.testing.assert_allclose(x, [0.0, 1.0, 5.0, 20.0])
        np.testing.assert_allclose(y, 1e9 * values_of(result, "worn_volume", frequency=2, scheme=number))
    assert "at 202 Hz" in drawing.caption
    last = 1e9 * float(values_of(result, "worn_volume", frequency=2, scheme=1)[-1])
    assert f"{last:.4g} mm³ ± 2 %, above rtol (explicit scheme)" in drawing.caption


@pytest.mark.parametrize(("name", "factor"), [("worn_volume", 1e9), ("wear_rate", 1e12)])
def test_maps_over_frequency_and_cycles(name, factor):
    result = make_result(frequency=[204.0, 200.0, 202.0, 201.0], failed=[2])
    drawing = draw_figure(result, f"{name}_map")
    for number in (0, 1):
        expected = factor * values_of(result, name, scheme=number)[[1, 3, 2, 0]].T
        np.testing.assert_allclose(cells_of(drawing.figure.axes[number]), expected)
    assert np.isnan(cells_of(drawing.figure.axes[0])).all(axis=0).tolist() == [True, False, False, False]
    assert drawing.figure.axes[0].patch.get_hatch()
    largest = factor * float(np.nanmax(result.dataset[name]))
    assert re.search(rf"The largest is {largest:.4g} mm³", drawing.caption)


def test_frequency_response_of_both_sweeps_is_open_at_the_fold():
    result = make_result(sweep=["up", "down"], scheme=["implicit"])
    branch, fold = result.dataset["branch"].copy(), result.dataset["fold_frequency"].copy()
    branch[2:, ..., 0] = 1
    fold[2, ..., 0] = 201.4
    drawing = draw_figure(with_variables(result, branch=branch, fold_frequency=fold), "frequency_response")
    lines = lines_of(drawing.figure.axes[0])
    for number, sweep in enumerate(("up", "down")):
        for cycle, text in ((0, "0 cycles"), (-1, "20 000 cycles")):
            x, y = lines[f"sweep {sweep}, {text.replace('20 000', '20' + chr(160) + '000')}"]
            known = np.isfinite(y)
            expected = 1e3 * values_of(result, "response_amplitude", sweep=number, cycle=cycle)
            np.testing.assert_allclose(y[known], expected)
            np.testing.assert_allclose(x[known], result.dataset["frequency"])
            gaps = [2] if (number, cycle) == (0, 0) else []
            assert np.flatnonzero(~known).tolist() == gaps
    assert lines["fold, sweep up"][0].tolist() == [201.4]
    assert "201.4 Hz (sweep up)" in drawing.caption


def test_unstable_states_are_ringed():
    result = make_result(scheme=["implicit"])
    stable = result.dataset["stable"].copy()
    stable[1, ..., -1] = 0
    x, y = lines_of(draw_figure(with_variables(result, stable=stable), "frequency_response").figure.axes[0])["unstable"]
    assert x.tolist() == [201.0]
    np.testing.assert_allclose(y, 1e3 * values_of(result, "response_amplitude", frequency=1, cycle=-1))


def test_natural_frequencies_and_mesh():
    result = with_sector(make_result())
    drawing = draw_figure(result, "natural_frequencies")
    left, right = drawing.figure.axes
    faces = next(item for item in left.collections if isinstance(item, PolyCollection))
    assert len(faces.get_paths()) == 6
    modes = [line for line in right.get_lines() if line.get_label() != "this study"]
    for line, mode in zip(modes, result.dataset["natural_frequency"].values.T, strict=True):
        np.testing.assert_allclose(line.get_ydata(), mode)
        np.testing.assert_allclose(line.get_xdata(), [0, 1, 2])
    x, y = lines_of(right)["this study"]
    assert x.tolist() == [0, 0]
    assert y.tolist() == [200.0, 204.0]
    assert "The lowest is 200 Hz" in drawing.caption


def test_outcome_map_tells_each_number_and_its_sentence():
    result = make_result(failed=[2, 5])
    drawing = draw_figure(result, "outcome_map")
    panel = drawing.figure.axes[0]
    found = {(round(text.get_position()[0]), round(text.get_position()[1])): text.get_text() for text in panel.texts}
    assert found == {(1, 0): "3", (2, 1): "3"}
    assert [label.get_text() for label in panel.get_yticklabels()] == ["implicit scheme", "explicit scheme"]
    assert [label.get_text() for label in panel.get_xticklabels()] == ["200", "201", "202", "204"]
    np.testing.assert_array_equal(cells_of(panel), [[0, 1, 0, 0], [0, 0, 1, 0]])
    assert "3: The branch was lost." in drawing.caption


def test_table_of_folds_and_jumps():
    result = make_result(sweep=["up", "down"])
    fold, jumps = result.dataset["fold_frequency"].copy(), result.dataset["jump_cycle"].copy()
    fold[1, ..., 1] = 201.5
    jumps[0, 0, 0, 0, 1, 0] = 4000.0
    table = find_table(with_variables(result, fold_frequency=fold, jump_cycle=jumps), "folds_and_jumps")
    # Both schemes share one sweep and its fold.
    assert table.rows == (
        ("fold", "201.5 Hz", "sweep down jumps to another branch"),
        ("jump while wearing", "4000 cycles", "branch lost at 200 Hz, explicit scheme, sweep up"),
    )


def test_table_of_stability():
    assert find_table(make_result(), "stability") is None
    result = make_result(failed=[7])
    limit = result.dataset["step_limit"].copy()
    limit[:2] = 800.0
    limit[2] = np.inf
    limit[3] = 900.0  # of a point that failed, perhaps for this
    table = find_table(with_variables(result, step_limit=limit), "stability")
    assert table.rows == (
        ("200 Hz, explicit scheme", "1000", "800", "yes", ""),
        ("201 Hz, explicit scheme", "1000", "800", "yes", ""),
        ("204 Hz, explicit scheme", "1000", "900", "yes", ""),
    )
    assert table.note.startswith("3 points with an explicit step longer than step_limit, 0 with")
