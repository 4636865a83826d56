"""`--date`: an attribute of choice, which changes nothing else."""

from pathlib import Path

import netCDF4
import pytest

from studyrunner.api import run_study
from studyrunner.cli import main
from studyrunner.result.creation_date import check_date
from studyrunner.user_error import UserError
from tests.studyrunner.faked_runs import SMALL

pytestmark = pytest.mark.usefixtures("folder")


def attributes(path="out.nc"):
    with netCDF4.Dataset(path) as file:
        return {name: file.getncattr(name) for name in file.ncattrs()}


@pytest.mark.parametrize(
    ("given", "kept"),
    [
        ("2026-11-23", "2026-11-23"),
        ("20261123", "2026-11-23"),
        ("2026-11-23T14:05", "2026-11-23T14:05:00"),
        ("2026-11-23 14:05:00Z", "2026-11-23T14:05:00Z"),
        ("20261123T140500+0100", "2026-11-23T14:05:00+01:00"),
        ("now", "now"),
    ],
)
def test_dates_are_kept_in_the_extended_form(given, kept):
    assert check_date(given, "command line", "--date") == kept


@pytest.mark.parametrize("wrong", ["", "23.11.2026", "2026-02-29", "1e9"])
def test_a_wrong_date_is_bad_input(wrong, capsys):
    assert main(["sdof_slider", f"--date={wrong}"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert "--date" in said[0]
    assert "2026-11-23T14:05:00Z" in said[0]
    assert list(Path().iterdir()) == []
    with pytest.raises(UserError, match="run_study: date"):
        run_study("sdof_slider", date=wrong)


def test_a_date_changes_nothing_else(solver):
    assert main(SMALL) == 0
    without, n_results = attributes(), solver.n_results
    assert "date_created" not in without
    solver.begin_again()
    # what is finished is known by the same hashes whatever the date
    assert main([*SMALL, "--date=2026-11-23"]) == 0
    assert attributes() == without | {"date_created": "2026-11-23"}
    assert main([*SMALL, "--date"]) == 0
    now = attributes()
    assert str(now.pop("date_created")).endswith("Z")
    assert now == without
    assert main(SMALL) == 0
    assert attributes() == without
    assert solver.n_results == 0 < n_results
