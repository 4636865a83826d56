"""Result files that are damaged, or of another kind, and names that are: status 2 and one line with the file."""

import contextlib
import os
import shutil
from collections import Counter
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from studyrunner.cli import main
from studyrunner.report import cli as report
from studyrunner.result.opening import check_dataset
from studyrunner.result.view import open_for_report
from studyrunner.user_error import UserError
from tests.benchmarks.fuzz_files import answer, write_whole_files
from tests.studies.scene_models import changed, poke
from tests.studyrunner.results import build_file, sample_file

STUDY = '[study]\nname = "s"\n[scene]\nmodel = "scene.h5"\nfriction_coefficient = 0.5\n[axes]\nfrequency = [150.0]\n'


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    path = tmp_path_factory.mktemp("made") / "out.nc"
    build_file(loops=(0,)).to_netcdf(path)
    return path


@pytest.fixture(autouse=True)
def result(made, folder):
    """A result file in the current folder."""
    shutil.copy(made, folder)


@pytest.fixture
def refused(capsys):
    def run(arguments, command=main):
        assert command(arguments) == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        (line,) = captured.err.splitlines()
        assert line.isprintable()
        assert len(line) < 1000
        return line

    return run


def cut(share):
    return lambda path: os.truncate(path, int(share * path.stat().st_size))


def written(content):
    return lambda path: path.write_bytes(content)


def dataset(*variables):
    return lambda path: xr.Dataset(*variables).to_netcdf(path)


def change_of(change):
    return lambda path: changed(path, change)


def attribute(name, value, variable):
    return change_of(lambda file: file[variable].attrs.__setitem__(name, value))


def study(text):
    def change(file):
        del file.attrs["study"]
        file.attrs.create("study", text, dtype=h5py.string_dtype("utf-8"))

    return change


WRONG = {
    "nothing": Path.unlink,
    "less than a third": cut(0.3),
    "without its end": cut(0.9),
    "a text": written(b"no NetCDF at all"),
    "an empty one": written(b""),
    "NetCDF-3": written(b"CDF\x01" + bytes(100)),
    "other data": dataset({"a": ("x", [1.0])}),
    "no point": dataset({"outcome": ("frequency", np.zeros(0, np.int8))}, {"cycle": [0.0], "contact": [0]}),
    "a frequency that is none": change_of(poke("frequency", 0, np.nan)),
    "number of a dimension as text": attribute("_Netcdf4Dimid", "first", "frequency"),
    "scale as text": attribute("scale_factor", "x", "worn_volume"),
    "cycles that do not rise": change_of(poke("cycle", 1, 1e9)),
    "a worn volume of 1e308": change_of(poke("worn_volume", ..., 1e308)),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_no_result_file_or_has_wrong_contents(case, folder, refused):
    WRONG[case](folder / "out.nc")
    assert refused(["out.nc"], report.main).startswith("study-report: out.nc")
    assert not (folder / "out-report").exists()
    with pytest.raises(UserError, match=r"out\.nc"):
        open_for_report("out.nc")
    if "third" in case or "end" in case:
        # others may be study files
        assert "out.nc: " in refused(["out.nc", "--plan"])


@pytest.mark.parametrize("text", ["1.5.2", "nan"])
def test_choices_are_numbers_or_auto(text, folder, refused):
    build_file(axes={"frequency": (190.0, 191.0), "harmonics": ("auto", "3", text)}).to_netcdf("words.nc")
    assert refused(["words.nc"], report.main).startswith("study-report: words.nc: harmonics")


@pytest.mark.slow
def test_numbers_that_are_damaged_where_they_are_large(folder, refused):
    """What is not read beforehand shows its damage while it is drawn."""
    axes = {"frequency": np.linspace(190.0, 200.0, 200), "scheme": ("implicit", "explicit")}
    made = build_file(axes, cycles=range(160))
    made.to_netcdf("large.nc", encoding={"wear_depth": {"zlib": True, "chunksizes": made["wear_depth"].shape}})
    with h5py.File("large.nc") as file:
        place = file["wear_depth"].id.get_chunk_info(0)
        assert file["wear_depth"].size * 8 > 2**23
    with Path("large.nc").open("rb+") as damaged:
        damaged.seek(place.byte_offset + 100)
        damaged.write(bytes(100))
    assert "large.nc: the file = damaged" in refused(["large.nc", "--no-compute"], report.main)


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
    made = sample_file().isel(sample=slice(4))
    drawn = np.full([made.sizes[name] for name in dimensions], content)
    dataset = made.assign_coords(sample_gap=(dimensions, drawn, {"units": "m"}))
    with contextlib.nullcontext() if is_right else pytest.raises(UserError, match="sample_gap"):
        xr.testing.assert_equal(check_dataset(dataset, "s.nc").sample_gap.variable, dataset.sample_gap.variable)


def linked(file):
    study(STUDY)(file)
    file.create_group("scene")["mass2"] = h5py.ExternalLink("other.h5", "/")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda file: file.attrs.__delitem__("study"), "study"),
        (study("[study"), "valid TOML"),
        (study("a = " + "[" * 50_000), "valid TOML"),
        (study(STUDY), "scene.model"),
        (linked, "mass2"),
    ],
)
def test_a_result_that_is_run_again(change, words, folder, refused):
    changed(folder / "out.nc", change)
    assert words in refused(["out.nc", "-o", "again.nc"])


def test_names_of_files_do_not_reach_the_terminal_raw(folder, refused, capsys):
    name = "\x1b[2J\udcff.toml"
    Path(name).write_text("[study", encoding="utf-8")
    assert r"\x1b[2J\udcff.toml" in refused([name])
    assert "[2J" in refused(["sdof_slider", "--set", "axes.step=\x1b[2J"])
    assert main(["sdof_slider", "--plan", "--set", 'study.title="a\\u001b[2J"']) == 0
    assert "\x1b" not in capsys.readouterr().out


# --- fuzzed scene, deck and result files: no traceback and no hang; `fuzz_files` tries thousands ---


@pytest.mark.slow
def test_fuzzed_files():
    write_whole_files()
    found = [answer(1, number) for number in range(16)]
    assert [each.wrong for each in found if each.wrong] == []
    # most of them are wrong, and not all
    ended = Counter(each.ended.split()[-1] for each in found)
    assert ended["2"] > 1
    assert ended["0"] > 0
