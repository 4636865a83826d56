"""Commit of the software, and the date in a result: where they are known or asked for, and nothing else."""

import subprocess
from pathlib import Path

import netCDF4
import pytest

from studyrunner.api import run_study
from studyrunner.cli import main
from studyrunner.result.provenance import CHANGED, check_date, commit_of
from studyrunner.user_error import UserError
from tests.studyrunner.faked_runs import SMALL


def test_the_commit_is_that_of_git(tmp_path, monkeypatch):
    def git(*arguments):
        command = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=b", *arguments]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    monkeypatch.setenv("GIT_CONFIG_GLOBAL", "/dev/null")
    git("init", "-q")
    head = ""
    for text in ("one", "two"):
        (tmp_path / "a.py").write_text(text, encoding="utf-8")
        git("add", "a.py")
        assert not head or commit_of(tmp_path) == head + CHANGED
        git("commit", "-qm", text)
        git("tag", "-a", text, "-m", "a name is no commit")
        head = git("rev-parse", "HEAD")
        assert commit_of(tmp_path) == head
    assert commit_of(tmp_path.parent) == ""


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
def test_date_and_software_stand_in_the_result_and_change_nothing_else(solver, monkeypatch):
    def run(*more, commit="b" * 40):
        solver.begin_again()
        monkeypatch.setattr("studyrunner.result.provenance.commit_of", lambda _: commit)
        assert main([*SMALL, *more]) == 0
        with netCDF4.Dataset("out.nc") as file:
            return {name: file.getncattr(name) for name in file.ncattrs()}

    there = run(commit="") | {"software_commit": "b" * 40}
    # what is finished is known by the same hashes whatever the date and the commit
    assert run("--date=2026-11-23") == there | {"date_created": "2026-11-23"}
    assert solver.n_results == 0
    now = run("--date")
    assert str(now.pop("date_created")).endswith("Z")
    assert now == there
