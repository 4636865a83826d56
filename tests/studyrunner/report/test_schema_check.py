"""Result files that are wrong: one sentence and status 2."""

import contextlib
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from studyrunner.report.cli import BAD_INPUT, main
from studyrunner.result.opening import check_dataset
from studyrunner.result.view import open_for_report
from studyrunner.user_error import UserError
from tests.studyrunner.results import build_file, sample_file


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "whole.nc"
    build_file(loops=(0,)).to_netcdf(path)
    return path


@pytest.fixture
def folder(whole, tmp_path, monkeypatch):
    shutil.copy(whole, tmp_path / "out.nc")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def attribute(name, value, variable=""):
    def change(file):
        (file[variable] if variable else file).attrs[name] = value

    return change


def study(text):
    def change(file):
        del file.attrs["study"]
        file.attrs.create("study", text, dtype=h5py.string_dtype("utf-8"))

    return change


def values(name, place, value):
    def change(file):
        file[name][place] = value

    return change


REFUSED = {
    "a frequency that is none": values("frequency", 0, np.nan),
    "study that is nested deeply": study("a = " + "[" * 50_000),
    "number of a dimension as text": attribute("_Netcdf4Dimid", "first", "frequency"),
    "scale as text": attribute("scale_factor", "x", "worn_volume"),
    "flags as text": attribute("flag_values", "0 1", "outcome"),
    "cycles that do not rise": values("cycle", 1, 1e9),
    "a worn volume of 1e308": values("worn_volume", ..., 1e308),
}


@pytest.mark.parametrize("case", REFUSED)
def test_refused_in_a_sentence(case, folder, capsys):
    with h5py.File("out.nc", "r+") as file:
        REFUSED[case](file)
    assert main(["out.nc"]) == BAD_INPUT
    said = capsys.readouterr()
    assert said.out == ""
    (line,) = said.err.splitlines()
    assert line.startswith("study-report: out.nc: ")
    assert line.isprintable()
    assert len(line) < 1000
    assert not (folder / "out-report").exists()
    with pytest.raises(UserError, match="give"):
        open_for_report("out.nc")


@pytest.mark.parametrize("text", ["1.5.2", "nan"])
def test_choices_are_numbers_or_auto(text, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    build_file(axes={"frequency": (190.0, 191.0), "harmonics": ("auto", "3", text)}).to_netcdf("out.nc")
    assert main(["out.nc"]) == BAD_INPUT
    assert capsys.readouterr().err.startswith("study-report: out.nc: harmonics: texts in place of numbers")


@pytest.mark.slow
def test_numbers_that_are_damaged_where_they_are_large(folder, capsys):
    """What is not read beforehand shows its damage while it is drawn."""
    axes = {"frequency": np.linspace(190.0, 200.0, 200), "scheme": ("implicit", "explicit")}
    made = build_file(axes, cycles=range(160))
    made.to_netcdf("large.nc", encoding={"wear_depth": {"zlib": True, "chunksizes": made["wear_depth"].shape}})
    with h5py.File("large.nc") as file:
        place = file["wear_depth"].id.get_chunk_info(0)
        assert file["wear_depth"].size * 8 > 2**23
    content = bytearray(Path("large.nc").read_bytes())
    content[place.byte_offset + 100 : place.byte_offset + 200] = bytes(100)
    Path("large.nc").write_bytes(content)
    assert main(["large.nc", "--no-compute"]) == BAD_INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert line == "study-report: large.nc: the file = damaged: give a result file of run-study that is whole"


@pytest.mark.parametrize(
    ("dimensions", "content", "is_right"),
    [
        (("frequency", "sample", "contact"), np.nan, True),
        (("contact", "sample"), 1.0, False),
        (("frequency", "contact"), 1.0, False),
        (("sample",), "text", False),
        (("sample",), np.nan, False),
    ],
)
def test_drawn_values_are_along_any_axes_in_order(dimensions, content, is_right):
    made = sample_file(4)
    drawn = np.full([made.sizes[name] for name in dimensions], content)
    dataset = made.assign_coords(sample_gap=(dimensions, drawn, {"units": "m"}))
    with contextlib.nullcontext() if is_right else pytest.raises(UserError, match="sample_gap"):
        xr.testing.assert_equal(check_dataset(dataset, "s.nc").sample_gap.variable, dataset.sample_gap.variable)
