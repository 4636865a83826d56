"""What a run finds beside its result: finished results, those of others, files of runs that were killed."""

import os
from pathlib import Path

import pytest
import xarray as xr

from studyrunner.cli import main
from studyrunner.netcdf.provenance import POINTS_LEFT
from tests.studyrunner.faked_runs import SMALL

pytestmark = pytest.mark.usefixtures("folder")

APART = [*SMALL, "--set", "solver.shortcuts=false"]
VARIANT = [*APART, "--set", "axes.excitation_amplitude=11"]
LARGER = [*APART, "--set", "axes.frequency=[100, 110, 120]"]
N_POINTS = 4


def interrupt(_, n_results):
    if n_results == 3:
        raise KeyboardInterrupt


@pytest.mark.slow
@pytest.mark.parametrize("command", [VARIANT, LARGER, [*APART, "--fresh"]], ids=["variant", "larger", "fresh"])
def test_a_finished_result_is_not_replaced_by_less(command, solver, folder, capsys):
    assert main(APART) == 0
    before = Path("out.nc").read_bytes()
    capsys.readouterr()
    solver.begin_again()
    solver.disturb = interrupt
    assert main(command) == 130
    said = capsys.readouterr().err.splitlines()[-1]
    assert said.startswith("run-study: interrupted: ")
    assert said.endswith("points are kept, out.nc is the finished result that it was, the same command goes on")
    assert Path("out.nc").read_bytes() == before
    # a finished one takes its place
    solver.begin_again()
    assert main(command) == 0
    with xr.open_dataset("out.nc") as result:
        assert (result.outcome == 0).all()
        assert result.attrs[POINTS_LEFT] == 0


@pytest.mark.slow
def test_a_variant_leaves_the_work_of_the_first_study(solver):
    assert main(APART) == 0
    # what starts over is its own work alone
    assert main([*VARIANT, "--fresh"]) == 0
    for command in (APART, VARIANT):
        solver.begin_again()
        assert main(command) == 0
        assert solver.tasks == []
    assert main([*VARIANT, "--prune"]) == 0
    assert solver.tasks == []
    assert main(VARIANT) == 0
    assert solver.tasks == []
    for command in (APART, [*APART, "--fresh"]):
        solver.begin_again()
        assert main(command) == 0
        assert len(solver.tasks) > N_POINTS


def test_what_a_killed_run_has_left_of_a_result_goes(solver, folder):
    """Also with the number of this process, as in containers, where all have the same."""
    for name in (f".out.nc.{os.getpid()}.partial", ".out.nc.4711.partial", ".out.nc.0123456789ab.partial"):
        Path(name).write_bytes(b"half a result")
    for name in (".out.nc.notes.partial", ".other.nc.4711.partial"):
        Path(name).touch()
    Path(".out.nc.99.partial").symlink_to(".other.nc.4711.partial")
    assert main(APART) == 0
    left = {path.name for path in folder.iterdir()}
    foreign = {".out.nc.99.partial", ".out.nc.notes.partial", ".other.nc.4711.partial"}
    assert left == {"out.nc", "out.nc.progress", *foreign}
