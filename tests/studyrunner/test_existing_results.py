"""Nothing is replaced unasked: results, finished or not, those of others, files of runs that were killed. Dates."""

import os
from pathlib import Path

import netCDF4
import pytest
import xarray as xr

from studyrunner import UserError, run_study
from studyrunner.cli import main
from studyrunner.result.provenance import check_date
from studyrunner.study.text import POINTS_LEFT
from tests.studyrunner.small_studies import SMALL

pytestmark = pytest.mark.usefixtures("solver", "folder")

OTHER = ["two_masses", "--set", "axes.scheme=implicit", "--set", "axes.frequency=0.05", "-o", "out.nc"]
RENAMED = [*SMALL, "--set", "study.name=mine"]
APART = [*SMALL, "--set", "solver.shortcuts=false"]
VARIANT = [*APART, "--set", "axes.excitation_amplitude=11"]
LARGER = [*APART, "--set", "axes.frequency=[100, 110, 120]"]


def files():
    return {path: path.read_bytes() for path in Path().rglob("*") if path.is_file()}


def finished(_):
    assert main(SMALL) == 0


def killed(solver):
    solver.end_at(1)
    assert main(SMALL) == 130
    Path("out.nc").unlink()


def without_progress(_):
    assert main(SMALL) == 0
    Path("out.nc.progress").unlink()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("leave", "other", "name"),
    [(finished, RENAMED, "mine"), (killed, OTHER, "two_masses"), (without_progress, OTHER, "two_masses")],
)
def test_what_is_left_of_another_study_stays(leave, other, name, solver, monkeypatch, capsys):
    leave(solver)
    before = files()
    solver.begin_again()
    capsys.readouterr()
    with monkeypatch.context() as early:
        # found before the scene is built
        early.setattr("studyrunner.scene.scene.build_study_scene", None)
        assert main(other) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert all(words in line for words in ('"sdof_slider"', f'"{name}"', "--overwrite", "out.nc"))
    assert (files(), solver.tasks) == (before, [])
    assert main([*other, "--overwrite"]) == 0
    with xr.open_dataset("out.nc") as result:
        assert f'name = "{name}"' in result.attrs["study"]
    # it is this one's now, and the first study cannot read what it replaces
    again = ["out.nc.old", "-o", "out.nc", "--overwrite"]
    assert not Path("out.nc.old").exists() or main(again) == 2
    assert main(other) == 0
    assert main(SMALL) == 2


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["broken", "measured", "scene"])
def test_what_is_no_result_is_not_replaced_at_all(kind, solver, capsys):
    if kind == "broken":
        Path("out.nc").write_bytes(b"\x89HDF\r\n\x1a\nand no more")
    elif kind == "measured":
        xr.Dataset({"measured": ("time", [1.0, 2.0])}).to_netcdf("out.nc")
    else:
        assert main(["sdof_slider", "--write-scene", "out.nc"]) == 0
    before = files()
    capsys.readouterr()
    for more in ([], ["--overwrite"], ["--fresh"]):
        assert main([*SMALL, *more]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith('run-study: command line: -o = "')
    assert main(["sdof_slider", "--write-scene", "out.nc"]) == 2
    assert files() == before
    assert not solver.tasks


@pytest.mark.slow
def test_in_python():
    assert main(SMALL) == 0
    overrides = {"axes.scheme": "implicit", "axes.frequency": 0.05}
    with pytest.raises(UserError, match="overwrite=True"):
        run_study("two_masses", "out.nc", overrides=overrides, progress=False)
    with run_study("two_masses", "out.nc", overrides=overrides, progress=False, overwrite=True) as result:
        assert 'name = "two_masses"' in result.attrs["study"]


@pytest.mark.slow
@pytest.mark.parametrize("command", [LARGER, [*APART, "--fresh"], [*OTHER, "--overwrite"]])
def test_a_finished_result_is_not_replaced_by_less(command, solver, capsys):
    assert main(APART) == 0
    before = Path("out.nc").read_bytes()
    solver.begin_again()
    solver.end_at(2)
    assert main(command) == 130
    assert "out.nc is the finished result that it was" in capsys.readouterr().err.splitlines()[-1]
    assert Path("out.nc").read_bytes() == before
    # a finished one takes its place
    solver.begin_again()
    assert main(command) == 0
    with xr.open_dataset("out.nc") as result:
        assert (result.outcome == 0).all()
        assert result.attrs[POINTS_LEFT] == 0
    # of other values the first one is kept, also when the second is computed again
    assert main(command) == 0
    old = Path("out.nc.old")
    assert (old.read_bytes() if old.exists() else None) == (None if "--fresh" in command else before)


@pytest.mark.slow
def test_a_variant_leaves_the_work_of_the_first_study(solver):
    assert main(APART) == 0
    # what starts over is its own work alone
    assert main([*VARIANT, "--fresh"]) == 0
    for command in (APART, VARIANT):
        solver.begin_again()
        assert main(command) == 0
        assert solver.tasks == []
    assert main([*APART, "--fresh"]) == 0
    assert len(solver.tasks) > 4


def test_what_a_killed_run_has_left_of_a_result_goes(folder):
    """Also with the number of this process, as in containers, where all have the same."""
    for name in (f".out.nc.{os.getpid()}.partial", ".out.nc.4711.partial", ".out.nc.0123456789ab.partial"):
        Path(name).write_bytes(b"half a result")
    for name in (".out.nc.notes.partial", ".other.nc.4711.partial"):
        Path(name).touch()
    Path(".out.nc.99.partial").symlink_to(".other.nc.4711.partial")
    assert main(SMALL) == 0
    left = {path.name for path in folder.iterdir()}
    foreign = {".out.nc.99.partial", ".out.nc.notes.partial", ".other.nc.4711.partial"}
    assert left == {"out.nc", "out.nc.progress", *foreign}


# --- the date of a result ---


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("20261123", "2026-11-23"),
        ("2026-11-23 14:05Z", "2026-11-23T14:05:00Z"),
        ("20261123T140500+0100", "2026-11-23T14:05:00+01:00"),
    ],
)
def test_dates_are_kept_in_the_extended_form(given, kept):
    assert check_date(given, "command line", "--date") == kept


def test_the_date_stands_in_the_result_and_changes_nothing_else(solver):
    def run(*more):
        solver.begin_again()
        assert main([*SMALL, *more]) == 0
        with netCDF4.Dataset("out.nc") as file:
            return {name: file.getncattr(name) for name in file.ncattrs()}

    there = run()
    # what is finished is known by the same hashes whatever the date
    assert run("--date=2026-11-23") == there | {"date_created": "2026-11-23"}
    assert solver.n_results == 0
    now = run("--date")
    assert str(now.pop("date_created")).endswith("Z")
    assert now == there
