"""The result file as the report reads it, how well volumes are known, and the command `study-report`."""

import errno
import os
from html import unescape

import numpy as np
import pytest

from studyrunner.api import open_result
from studyrunner.report import contents
from studyrunner.report.cli import BAD_INPUT, INTERRUPTED, UNEXPECTED, WRITTEN, main
from studyrunner.report.contents import draw_report
from studyrunner.report.drawing import COLUMN_WIDTH, Missing, Table
from studyrunner.report.page import write_page
from studyrunner.result.view import open_for_report
from studyrunner.summary.answer import certainty_of
from studyrunner.units import scale_for
from studyrunner.user_error import UserError
from tests.studyrunner.report.cases import draw_figure
from tests.studyrunner.results import build_file, fail, smooth_result


def test_the_shown_point_wears_most_of_those_to_be_trusted_or_is_chosen(tmp_path):
    result = smooth_result()
    # the explicit scheme wears more everywhere, but is not shown
    assert int(result.dataset["worn_volume"].isel(cycle=-1).argmax(...)["scheme"]) == 1
    assert result.shown == dict.fromkeys(result.axes, 0) | {"frequency": 2, "scheme": 0}
    build_file().to_netcdf(tmp_path / "out.nc")
    chosen = open_for_report(tmp_path / "out.nc", {"frequency": "193", "scheme": "explicit"})
    assert (chosen.shown["frequency"], chosen.shown["scheme"]) == (3, 1)
    chosen.dataset.close()
    for wrong in ({"frequency": "1"}, {"mu": "1"}):
        with pytest.raises(UserError, match=next(iter(wrong))):
            open_for_report(tmp_path / "out.nc", wrong)


@pytest.mark.parametrize(
    ("units", "largest", "shown"),
    [
        ("m", 4.2e-3, "4.2 mm"),
        ("m", 139.0, "139 m"),
        ("m3", 2.25e-9, "2.25 mm³"),
        ("m3 per cycle", 1.2e-13, "0.12 mm³ per kcycle"),
        ("Pa", 23.4e6, "23.4 MPa"),
        ("cycles", 1e5, "100 kcycles"),
        ("rad", np.pi, "180 °"),
        ("1", 0.25, "0.25"),
        ("furlong", 2.0, "2 furlong"),
        ("m", 0.0, "0 mm"),
    ],
)
def test_prefixes_fit_the_values(units, largest, shown):
    assert scale_for(units, [np.nan, 0.1 * largest, -largest]).show(largest) == shown


def test_the_certainty_stands_on_the_page(tmp_path):
    """One point ended early, one is above rtol, one sensitive and one has no state; others are known to rtol or not."""
    result = smooth_result(failed=[7])
    fail(result.dataset, 2, 3, 6000.0, "it broke off")
    fail(result.dataset, 4, 6, 20_000.0, "the wear rate is known to 2.6 % only")
    fail(result.dataset, 5, 15, 20_000.0)
    known = certainty_of(result)
    assert [known.values[name] for name in ("n_known", "n_less", "n_unknown")] == [2, 4, 0]
    assert (known.values["worst"], known.values["where"]) == (0.02, "202 Hz, implicit scheme")
    write_page(result, [], tmp_path / "index.html")
    html = unescape((tmp_path / "index.html").read_text(encoding="utf-8"))
    assert known.text in html


def test_an_inaccurate_state_is_no_volume_above_rtol():
    """Known to rtol is what its error says, whatever the outcome."""
    result = smooth_result()
    fail(result.dataset, 0, 6, 20_000.0, "the response is known to 3 % only")
    assert float(result.errors.flat[0]) < 0.01
    assert not result.above.flat[0]
    known = certainty_of(result)
    assert (known.values["n_known"], known.values["n_less"]) == (2, 6)


def test_a_point_at_its_target_is_drawn_where_it_ended():
    """It is computed to the end, with no values at later counts."""
    result = smooth_result()
    for point in range(8):
        fail(result.dataset, point, 0, 6000.0)
    assert result.last_reached(result.shown) == 2
    assert "5000 cycles" in draw_figure(result, "worn_profile").caption.replace("\N{NO-BREAK SPACE}", " ")


@pytest.mark.slow
def test_a_result_of_version_0_4_is_opened_and_reported(tmp_path):
    """It holds fewer variables, and its outcomes have no sentences."""
    made = build_file(loops=(0, 1), failed=(3,))
    since = ("last_cycle", "error_estimate", "worn_volume_error", "largest_wear_depth", "wear_depth_error", "message")
    since += ("response_error", "wear_rate_error", "cycles_to_target", "cycles_to_target_error")
    old = made.drop_vars([name for name in since if name in made])
    words = made["outcome"].attrs["flag_meanings"].split()[:14]
    old["outcome"].attrs = {"flag_values": np.arange(14, dtype=np.int8), "flag_meanings": " ".join(words)}
    old.attrs["study"] += "[outputs]\nloops = [0, 1]\n"
    old.to_netcdf(tmp_path / "old.nc")
    assert len(list(draw_report(open_for_report(tmp_path / "old.nc")))) > 10
    with open_result(tmp_path / "old.nc") as opened:
        assert opened.fretwear.outcomes().values.ravel()[3] == "march_failed"
        assert opened["loop_contact"].values.tolist() == [0, 1]
        assert "error not known" in str(opened.fretwear.summary())


# --- the command `study-report` ---


@pytest.fixture
def draw(monkeypatch, tmp_path):
    """A folder with a result; a report has no figures, and what is given here is done before they would be drawn."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "results").mkdir()
    build_file().to_netcdf(tmp_path / "results" / "worn.x.nc")

    def use(error=None):
        def report(_result, width):
            use.width = width
            if error is not None:
                raise error
            yield Missing("loops", "[bold]Loops", "Ask for them.")
            yield Table(("a",), (("b",),), "", "t", "Table")

        monkeypatch.setattr(contents, "draw_report", report)

    use()
    return use


def test_the_folder_is_named_after_the_file_and_lies_here(draw, tmp_path, capsys):
    assert main(["results/worn.x.nc", "--no-compute", "--column"]) == WRITTEN
    assert draw.width == COLUMN_WIDTH
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
        (["results"], "results"),
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


@pytest.mark.processes
def test_a_full_disk_is_one_line(draw, capsys):
    draw(OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
    assert main(["results/worn.x.nc", "-o", "out", "--no-compute"]) == BAD_INPUT
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith('study-report: command line: -o = "out": ')


@pytest.mark.processes
def test_failures_have_a_traceback_and_signals_have_none(draw, capsys):
    draw(ZeroDivisionError("broken"))
    assert main(["results/worn.x.nc"]) == UNEXPECTED
    assert "ZeroDivisionError: broken" in capsys.readouterr().err
    draw(KeyboardInterrupt())
    assert main(["results/worn.x.nc", "--no-compute"]) == INTERRUPTED
    assert capsys.readouterr().err == "study-report: interrupted\n"
