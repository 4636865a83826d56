"""The date in a result: where it is asked for, and nothing else."""

from pathlib import Path

import netCDF4
import pytest

from studyrunner.api import run_study
from studyrunner.cli import main
from studyrunner.result.provenance import check_date
from studyrunner.user_error import UserError
from tests.studyrunner.faked_runs import SMALL


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("20261123", "2026-11-23"),
        ("2026-11-23 14:05Z", "2026-11-23T14:05:00Z"),
        ("20261123T140500+0100", "2026-11-23T14:05:00+01:00"),
        ("now", "now"),
    ],
)
def test_dates_are_kept_in_the_extended_form(given, kept):
    assert check_date(given, "command line", "--date") == kept


@pytest.mark.usefixtures("folder")
def test_a_wrong_date_is_bad_input(capsys):
    assert main(["sdof_slider", "--date=2026-02-29"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "--date" in line
    assert list(Path().iterdir()) == []
    with pytest.raises(UserError, match="run_study: date"):
        run_study("sdof_slider", date="")


@pytest.mark.usefixtures("folder")
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
