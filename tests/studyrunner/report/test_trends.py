"""Trends and maps of studies of several axes: against the file, a parabola in closed form, and what is left out."""

import base64
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import QuadMesh

from studyrunner.report.page.trends import build_trend_numbers
from studyrunner.report.trends.figures import draw_trends
from studyrunner.report.trends.quantities import find_peak, find_quantities
from tests.studyrunner.report.figure_cases import make_result, with_variables

FREQUENCIES = (199.0, 200.0, 201.0, 202.0, 203.0, 204.0, 205.0, 206.0)


def many():
    """8 x 3 x 2 x 2 points; the harmonics of another file make 2 more of each."""
    return make_result(frequency=FREQUENCIES, wear_coefficient=(1e-12, 5e-12, 1e-11), sweep=("up", "down"))


def test_a_peak_of_a_parabola_is_found_between_uneven_frequencies():
    frequency = np.array([203.0, 200.0, 201.5, 202.2])
    centre, top = np.array([201.1, 201.9]), np.array([2e-3, 3e-3])
    amplitude = top - 1e-4 * (frequency[:, None] - centre) ** 2
    found, height, away, rise = find_peak(frequency, amplitude, 0)
    np.testing.assert_allclose(found[0], centre, rtol=1e-9)
    np.testing.assert_allclose(height[0], top, rtol=1e-9)
    np.testing.assert_allclose(away[0], [0.4, 0.3], rtol=1e-6)
    np.testing.assert_allclose(rise[0], 1e-4 * np.array([0.16, 0.09]), rtol=1e-6)


@pytest.mark.parametrize("values", [[1.0, 2.0, 3.0], [3.0, 2.0, 1.0], [np.nan, 2.0, 1.0], [np.nan] * 3])
def test_a_peak_at_an_end_is_not_known(values):
    assert np.isnan(find_peak(np.arange(3.0), np.array(values), 0)).all()


def test_the_shift_is_that_of_the_response_between_the_first_and_the_last_cycle():
    result = many()
    amplitude = result.dataset["response_amplitude"].copy(deep=True)
    frequency = result.dataset["frequency"]
    for cycle, centre in ((0, 202.3), (-1, 203.6)):
        amplitude[{"cycle": cycle}] = (2e-3 - 1e-5 * (frequency - centre) ** 2).broadcast_like(
            amplitude.isel(cycle=cycle)
        )
    found = find_quantities(with_variables(result, response_amplitude=amplitude))
    shift = next(one for one in found if one.units == "Hz")
    assert shift.values.shape == (1, 3, 1, 1, 2, 2)
    np.testing.assert_allclose(shift.values, 1.3, rtol=1e-6)
    np.testing.assert_allclose(shift.errors, 0.3 + 0.4, rtol=1e-6)


def test_lines_and_maps_are_those_of_the_file():
    result = many()
    trends, maps = draw_trends(result)
    shown = result.shown_point()
    worn = result.dataset["worn_volume"].isel(cycle=-1).values
    place = tuple(shown[name] for name in result.axes)
    panels = [panel for panel in trends.figure.axes if panel.get_subplotspec().rowspan.start == 0]
    assert len(panels) == 4
    for panel, axis in zip(panels, (0, 1, 4, 5), strict=True):
        own = worn[(*place[:axis], slice(None), *place[axis + 1 :])]
        drawn = [np.asarray(each.get_ydata(), dtype=float) for each in panel.get_lines() if each.get_marker() == "o"]
        np.testing.assert_allclose(drawn[0] / drawn[0].max(), own / own.max(), rtol=1e-12)
    fields = [
        np.asarray(found.get_array())
        for panel in maps.figure.axes
        for found in panel.collections
        if isinstance(found, QuadMesh) and found.get_array() is not None and len(np.shape(found.get_array())) == 2
    ]
    expected = worn[:, :, 0, 0, place[4], place[5]].T
    assert any(
        field.shape == expected.shape and np.allclose(field / field.max(), expected / expected.max())
        for field in fields
    )


def test_the_page_gets_the_numbers_of_the_file_in_si():
    result = many()
    dataset = result.dataset
    estimated = np.linspace(0.0, 0.3, result.computed.size).reshape(result.computed.shape)
    result = with_variables(result, error_estimate=dataset["outcome"].astype(float).copy(data=estimated))
    numbers: list[Any] = build_trend_numbers(result) or []
    assert [one["unit"] for one in numbers] == ["mm³", "%", "mm", "Hz"]
    for one in numbers:
        for name in ("data", "errors"):
            one[name] = one[name] and np.frombuffer(base64.b64decode(one[name]), "<f4").reshape(one["sizes"])
    volume, error, peak, _ = numbers
    worn = dataset["worn_volume"].isel(cycle=-1).values
    np.testing.assert_allclose(volume["data"], worn, rtol=1e-6)
    np.testing.assert_allclose(volume["errors"], worn * estimated, rtol=1e-6)
    assert volume["factor"] == 1e9
    assert error["errors"] is None
    told = np.isfinite(error["data"])
    np.testing.assert_array_equal(told, estimated > 0.0)
    np.testing.assert_allclose(error["data"][told] * error["factor"], 100.0 * estimated[told], rtol=1e-6)
    assert peak["sizes"] == [1, *worn.shape[1:]]
