"""The result file as the report reads it: opening, shown point, choice of combinations, units."""

import numpy as np
import pytest
import xarray as xr

from studyrunner.api import open_result
from studyrunner.report.selection import choose
from studyrunner.result.view import open_for_report
from studyrunner.units import scale_for, show_cycles, show_number, show_power
from studyrunner.user_error import UserError
from tests.studyrunner.results import make_result

NO_POINT = xr.Dataset({"outcome": ("frequency", np.zeros(0, np.int8))}, {"cycle": [0.0], "contact": [0]})


@pytest.mark.parametrize(
    ("content", "remedy"),
    [
        (None, "there is none of this name"),
        (b"no NetCDF at all", "is no NetCDF file"),
        (b"", "is no NetCDF file"),
        (xr.Dataset({"a": ("x", [1.0])}), "holds no outcome and no cycle and no contact"),
        (NO_POINT, "frequency = 0 values"),
    ],
)
@pytest.mark.parametrize("opening", [open_for_report, open_result])
def test_what_is_no_result_file_is_refused_in_one_line(tmp_path, opening, content, remedy):
    path = tmp_path / "file.nc"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content is not None:
        content.to_netcdf(path)
    with pytest.raises(UserError) as caught:
        opening(path)
    assert remedy in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_shown_point_wears_most_of_those_to_be_trusted():
    result = make_result()
    # The explicit scheme wears more everywhere, but is not shown.
    volume = result.dataset["worn_volume"].isel(cycle=-1)
    assert int(volume.argmax(...)["scheme"]) == 1
    assert result.shown_point() == dict.fromkeys(result.axes, 0) | {"frequency": 2, "scheme": 0}


def test_combinations_within_the_limit_are_all_chosen():
    choice = choose(make_result(sweep=["up", "down"]), ["frequency"], 4)
    assert choice.labels == (
        "implicit scheme, sweep up",
        "implicit scheme, sweep down",
        "explicit scheme, sweep up",
        "explicit scheme, sweep down",
    )
    assert choice.sentence == ""
    assert all("frequency" not in point for point in choice.points)


@pytest.mark.parametrize(
    ("units", "largest", "shown"),
    [
        ("m", 4.2e-3, "4.2 mm"),
        ("m", 139.0, "139 m"),
        ("m3", 2.25e-9, "2.25 mm³"),
        ("m3 per cycle", 1.2e-13, "0.12 mm³ per kcycle"),
        ("Pa", 23.4e6, "23.4 MPa"),
        ("cycles", 1e5, "100 kcycles"),
        ("rad", np.pi, "180 °"),
        ("1", 0.25, "0.25"),
        ("furlong", 2.0, "2 furlong"),
        ("m", 0.0, "0 mm"),
    ],
)
def test_prefixes_fit_the_values(units, largest, shown):
    assert scale_for(units, [np.nan, 0.1 * largest, -largest]).show(largest) == shown


def test_numbers_in_words():
    assert show_number(100000.0) == "100\N{NO-BREAK SPACE}000"
    assert show_number(1234.5678) == "1234.57"
    assert show_number(23412.87, 4) == "23\N{NO-BREAK SPACE}410"
    assert show_number(2.1234567e11 + 0.5, 4) == "2.123e+11"
    assert show_cycles(23412.87) == "23\N{NO-BREAK SPACE}410 cycles"
    assert show_cycles(123456.0) == "123\N{NO-BREAK SPACE}456 cycles"
    assert show_cycles(1) == "1 cycle"
    assert show_cycles(0) == "0 cycles"
    assert " ".join(map(show_power, (1.0, 0.1, 1e-12, 1e4, 2e-3, 0.0))) == "1 10⁻¹ 10⁻¹² 10⁴ 0.002 "
