"""The result file as the report reads it: opening, shown point, choice of combinations, units."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from studyrunner.report.reading.result import Result, as_sentences, open_for_report
from studyrunner.report.reading.units import Scale, scale_for, show_cycles, show_number, show_power
from studyrunner.user_error import UserError
from tests.studyrunner.report.figure_cases import make_result, with_variables


@pytest.mark.slow
def test_a_result_file_is_opened_lazily(tmp_path: Path) -> None:
    path = tmp_path / "made.nc"
    made = make_result()
    made.dataset.to_netcdf(path)
    result = open_for_report(path)
    assert not result.dataset["worn_volume"].variable._in_memory
    assert result.axes == made.axes
    assert result.title == "Made up"
    np.testing.assert_array_equal(result.read("worn_volume").values, made.dataset["worn_volume"].values)
    assert result.shown_point() == made.shown_point()
    result.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("content", "remedy"),
    [
        (None, "there is no such file"),
        (b"no NetCDF at all", "is no NetCDF file"),
        (b"", "is no NetCDF file"),
        (xr.Dataset({"a": ("x", [1.0])}), "holds no outcome and no cycle and no contact"),
        (
            xr.Dataset(
                {"outcome": ("frequency", np.zeros(0, dtype=np.int8))},
                {"cycle": ("cycle", [0.0]), "contact": ("contact", [0])},
            ),
            "holds no point",
        ),
    ],
)
def test_what_is_no_result_file_is_refused_in_one_line(tmp_path: Path, content: object, remedy: str) -> None:
    path = tmp_path / "file.nc"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif isinstance(content, xr.Dataset):
        content.to_netcdf(path)
    with pytest.raises(UserError) as caught:
        open_for_report(path)
    assert remedy in str(caught.value)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_shown_point_wears_most_of_those_to_be_trusted() -> None:
    result = make_result()
    # The explicit scheme wears more everywhere, but is not shown.
    volume = result.dataset["worn_volume"].isel(cycle=-1)
    assert int(volume.argmax(...)["scheme"]) == 1
    assert result.shown_point() == dict.fromkeys(result.axes, 0) | {"frequency": 2, "scheme": 0}


def test_the_shown_point_does_not_oscillate_where_another_does_not() -> None:
    result = make_result()
    oscillates = result.dataset["oscillates"].copy()
    oscillates[2] = 1
    assert with_variables(result, oscillates=oscillates).shown_point()["frequency"] in (1, 3)
    oscillates[:] = 1
    assert with_variables(result, oscillates=oscillates).shown_point()["frequency"] == 2


@pytest.mark.parametrize(
    ("result", "expected"),
    [
        (make_result(scheme=["explicit"]), (2, 0)),
        (make_result(failed=[4]), (1, 0)),
        (make_result(failed=[0, 2, 4, 6]), (2, 1)),
        (make_result(wears=False), (2, 0)),
        (make_result(without=["worn_volume"]), (2, 0)),
        (make_result(without=["worn_volume", "response_amplitude"], failed=[0]), (1, 0)),
        (make_result(failed=range(8)), (0, 0)),
    ],
)
def test_the_shown_point_where_something_is_lacking(result: Result, expected: tuple[int, int]) -> None:
    shown = result.shown_point()
    assert (shown["frequency"], shown["scheme"]) == expected


def test_combinations_within_the_limit_are_all_chosen() -> None:
    choice = make_result(sweep=["up", "down"]).choose(["frequency"], 4)
    assert choice.labels == (
        "implicit scheme, sweep up",
        "implicit scheme, sweep down",
        "explicit scheme, sweep up",
        "explicit scheme, sweep down",
    )
    assert choice.sentence == ""
    assert all("frequency" not in point for point in choice.points)


def test_beyond_the_limit_the_shown_point_stands_for_the_rest() -> None:
    result = make_result(wear_coefficient=[1e-12, 1e-11, 1e-10], sweep=["up", "down"])
    choice = result.choose(["frequency"], 4)
    assert {point["wear_coefficient"] for point in choice.points} == {2}
    assert choice.sentence == (
        "Shown for wear coefficient 1e-10 1/Pa; the file also holds 2 other values of wear coefficient."
    )
    single = result.choose(["frequency"], 1)
    shown = result.shown_point()
    assert single.points == ({name: index for name, index in shown.items() if name != "frequency"},)


def test_points_in_words() -> None:
    result = make_result(frequency=[212.25, 213.0])
    assert result.describe({"frequency": 0, "scheme": 1}) == "212.25 Hz, explicit scheme"
    single = make_result(frequency=[212.25], scheme=["implicit"])
    assert single.describe(single.shown_point()) == (
        "212.25 Hz, wear coefficient 1.1e-11 1/Pa, excitation amplitude 0.5 N, step 1000 cycles, implicit scheme,"
        " sweep up"
    )


def test_outcomes_are_told_by_the_file() -> None:
    result = make_result(failed=[1], failing=-1)
    assert result.endings[-1].word == "not_computed"
    assert result.endings[-1].sentence == "It was not reached."
    # what files of earlier versions claim of every point that was computed to the end
    older = make_result()
    sentences = older.dataset["outcome"].attrs["sentences"].replace("It was computed.", "It was computed to tolerance.")
    older.dataset["outcome"].attrs["sentences"] = sentences
    assert older.endings[0].sentence == "It was computed to the end."
    del result.dataset["outcome"].attrs["sentences"]
    bare = Result(result.path, result.dataset)
    assert bare.endings[3].sentence == "branch lost"
    unknown = make_result(failed=[1], failing=77)
    assert unknown.endings[77].sentence == "outcome 77"


def test_a_study_that_cannot_be_read_is_empty() -> None:
    result = make_result()
    result.dataset.attrs["study"] = "= nonsense"
    assert result.study == {}


@pytest.mark.parametrize(
    ("units", "largest", "shown"),
    [
        ("m", 4.2e-3, "4.2 mm"),
        ("m", 14.7e-6, "14.7 µm"),
        ("m", 2e-9, "2 nm"),
        ("m", 139.0, "139 m"),
        ("m3", 2.25e-9, "2.25 mm³"),
        ("m3", 3e-15, "3000 µm³"),
        ("m3 per cycle", 1.2e-13, "0.12 mm³ per kcycle"),
        ("Pa", 23.4e6, "23.4 MPa"),
        ("Pa", 1280.0, "1.28 kPa"),
        ("cycles", 1e5, "100 kcycles"),
        ("cycles", 400.0, "400 cycles"),
        ("N", 560.0, "560 N"),
        ("rad", np.pi, "180 °"),
        ("1", 0.25, "0.25"),
        ("furlong", 2.0, "2 furlong"),
        ("m", 0.0, "0 mm"),
    ],
)
def test_prefixes_fit_the_values(units: str, largest: float, shown: str) -> None:
    assert scale_for(units, [np.nan, 0.1 * largest, -largest]).show(largest) == shown


def test_round_off_of_the_largest_is_shown_as_zero() -> None:
    """A mean of 2.76e-23 m beside depths of micrometres is none; a millionth of the largest is a value."""
    scale = scale_for("m", [8e-6, 2.76e-23])
    assert scale.show(2.76e-23) == "0 µm"
    assert scale.show(-2.76e-23) == "0 µm"
    assert scale.show(8e-12) == "8e-06 µm"
    assert scale_for("m", [2.76e-9]).show(2.76e-9) == "2.76 nm"


def test_scales_apply_to_arrays_and_labels() -> None:
    scale = Scale(1e3, "mm")
    np.testing.assert_allclose(scale([1e-3, np.nan]), [1.0, np.nan])
    assert scale.label("amplitude") == "amplitude (mm)"
    assert Scale(1.0, "").label("error") == "error"


def test_numbers_in_words() -> None:
    assert show_number(100000.0) == "100\N{NO-BREAK SPACE}000"
    assert show_number(1234.5678) == "1234.57"
    assert show_number(23412.87, 4) == "23\N{NO-BREAK SPACE}410"
    assert show_number(2.1234567e11 + 0.5, 4) == "2.123e+11"
    assert show_cycles(23412.87) == "23\N{NO-BREAK SPACE}410 cycles"
    assert show_cycles(123456.0) == "123\N{NO-BREAK SPACE}456 cycles"
    assert show_cycles(1) == "1 cycle"
    assert show_cycles(0) == "0 cycles"
    assert [show_power(value) for value in (1.0, 0.1, 1e-12, 1e4, 2e-3, 0.0)] == [
        "1",
        "10⁻¹",
        "10⁻¹²",
        "10⁴",
        "0.002",
        "",
    ]


def test_sentences_end_once() -> None:
    assert as_sentences("One", "", "Two.", "Three") == "One. Two. Three."
