"""The command `study-report`: what it writes, what it says, how it ends."""

import subprocess
import sys

import pytest

from studyrunner.report import contents
from studyrunner.report.cli import BAD_INPUT, INTERRUPTED, UNEXPECTED, WRITTEN, main
from studyrunner.report.drawing import Missing, Table
from tests.studyrunner.results import build_file

pytestmark = pytest.mark.processes


def short_report(_result):
    yield Missing("loops", "[bold]Loops", "Ask for them.")
    yield Table(("a",), (("b",),), "", "t", "Table")


@pytest.fixture
def short(monkeypatch, tmp_path):
    """A folder to work in, with a result file; a report has no figures."""
    monkeypatch.setattr(contents, "draw_report", short_report)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "results").mkdir()
    build_file().to_netcdf(tmp_path / "results" / "worn.x.nc")
    return tmp_path


def test_the_folder_is_named_after_the_file_and_lies_here(short, capsys):
    assert main(["results/worn.x.nc", "--no-compute"]) == WRITTEN
    said = capsys.readouterr()
    assert (short / "worn.x-report" / "index.html").is_file()
    assert said.out.startswith("worn.x-report/index.html: 0 figures, 1 table, 1 left out, ")
    assert "open it in a browser" in said.out
    assert said.out.count("\n") == 1
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
def test_bad_input_is_one_line(short, capsys, arguments, key):
    (short / "text.nc").write_text("no result")
    assert main(arguments) == BAD_INPUT
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("study-report: ")
    assert said.err.count("\n") == 1
    assert key in said.err
    assert sorted(path.name for path in short.iterdir()) == ["results", "text.nc"]


def test_an_unexpected_failure_has_a_traceback(short, capsys, monkeypatch):
    def fail(_result):
        raise ZeroDivisionError("broken")

    monkeypatch.setattr(contents, "draw_report", fail)
    assert main(["results/worn.x.nc"]) == UNEXPECTED
    said = capsys.readouterr().err
    assert "unexpected failure" in said
    assert "ZeroDivisionError: broken" in said


def test_a_signal_ends_the_command(short, capsys, monkeypatch):
    def interrupted(_result):
        raise KeyboardInterrupt

    monkeypatch.setattr(contents, "draw_report", interrupted)
    assert main(["results/worn.x.nc", "--no-compute"]) == INTERRUPTED
    assert capsys.readouterr().err == "study-report: interrupted\n"


def test_help_has_examples_and_does_not_load_the_libraries(capsys):
    assert main(["--help"]) == WRITTEN
    text = capsys.readouterr().out
    assert "study-report dovetail.nc" in text
    assert "exit status" in text
    code = (
        "import sys; from studyrunner.report.cli import main; main(['--help']);"
        "sys.exit(bool({'matplotlib', 'plotly', 'xarray', 'numpy'} & set(sys.modules)))"
    )
    subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.DEVNULL)
