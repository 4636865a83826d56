"""The command `study-report`: what it writes, what it says, how it ends."""

import errno
import os

import pytest

from studyrunner.report import contents
from studyrunner.report.cli import BAD_INPUT, INTERRUPTED, UNEXPECTED, WRITTEN, main
from studyrunner.report.drawing import Missing, Table
from tests.studyrunner.results import build_file

pytestmark = pytest.mark.processes


@pytest.fixture
def draw(monkeypatch, tmp_path):
    """A folder with a result; a report has no figures, and what is given here is done before they would be drawn."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "results").mkdir()
    build_file().to_netcdf(tmp_path / "results" / "worn.x.nc")

    def use(error=None):
        def report(_result):
            if error is not None:
                raise error
            yield Missing("loops", "[bold]Loops", "Ask for them.")
            yield Table(("a",), (("b",),), "", "t", "Table")

        monkeypatch.setattr(contents, "draw_report", report)

    use()
    return use


def test_the_folder_is_named_after_the_file_and_lies_here(draw, tmp_path, capsys):
    assert main(["results/worn.x.nc", "--no-compute"]) == WRITTEN
    said = capsys.readouterr()
    assert (tmp_path / "worn.x-report" / "index.html").is_file()
    (line,) = said.out.splitlines()
    assert line.startswith("worn.x-report/index.html: 0 figures, 1 table, 1 left out, ")
    assert said.err == ""


@pytest.mark.parametrize(
    ("arguments", "key"),
    [
        ([], "options"),
        (["results/worn.x.nc", "--folder", "x"], "options"),
        (["nowhere.nc"], "nowhere.nc"),
        (["results"], "results"),
        (["text.nc"], "text.nc"),
        (["results/worn.x.nc", "-o", "text.nc"], '-o = "text.nc"'),
        (["results/worn.x.nc", "-o", "text.nc/inside"], '-o = "text.nc/inside"'),
    ],
)
def test_bad_input_is_one_line(draw, tmp_path, capsys, arguments, key):
    (tmp_path / "text.nc").write_text("no result")
    assert main(arguments) == BAD_INPUT
    said = capsys.readouterr()
    assert said.out == ""
    (line,) = said.err.splitlines()
    assert line.startswith("study-report: ")
    assert key in line
    assert sorted(path.name for path in tmp_path.iterdir()) == ["results", "text.nc"]


def test_a_full_disk_is_one_line(draw, capsys):
    draw(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
    assert main(["results/worn.x.nc", "-o", "out", "--no-compute"]) == BAD_INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith('study-report: command line: -o = "out": ')


def test_failures_have_a_traceback_and_signals_have_none(draw, capsys):
    draw(ZeroDivisionError("broken"))
    assert main(["results/worn.x.nc"]) == UNEXPECTED
    assert "ZeroDivisionError: broken" in capsys.readouterr().err
    draw(KeyboardInterrupt())
    assert main(["results/worn.x.nc", "--no-compute"]) == INTERRUPTED
    assert capsys.readouterr().err == "study-report: interrupted\n"
