"""What the report says of how well worn volumes are known: bands, bars, marks, sentences; and of older files."""

import re

import numpy as np
import pytest

from studyrunner.api import open_result
from studyrunner.report.cli import main
from studyrunner.report.page.page import write_page
from studyrunner.result.certainty import certainty_of, describe_ended
from tests.studyrunner.report.figure_numbers import draw_figure
from tests.studyrunner.results import build_file, make_result, with_endings

# flat indices: frequency 200, 201, 202, 204 times implicit, explicit; errors 2 % at 202 Hz, 1.3 % beside it
EARLY, ABOVE, SENSITIVE, LOST = 2, 4, 5, 7


def mixed():
    """One point ended early, one is above rtol, one sensitive and one has no state; others are known to rtol or not."""
    endings = {EARLY: (3, 6000.0), ABOVE: (6, 20_000.0), SENSITIVE: (15, 20_000.0)}
    messages = {ABOVE: "from cycle 1000 on the wear rate is known to 2.6 % only", EARLY: "it broke off"}
    return with_endings(make_result(failed=[LOST]), endings, messages)


def test_certainty_and_the_points_that_ended_otherwise_stand_on_the_page(tmp_path):
    result = mixed()
    known = certainty_of(result)
    assert (known.n_points, known.n_known, known.n_less, known.n_short) == (8, 2, 4, 2)
    assert (known.worst, known.where) == (0.02, "202 Hz, implicit scheme")
    write_page(result, [], tmp_path / "index.html")
    html = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert html.index(known.sentence.replace('"', "&quot;")) < html.index("8 points, 6 computed")
    for number, word in ((6, "2.6 % only"), (3, "it broke off")):
        line = next(each for each in describe_ended(result, number) if each.endswith(word))
        assert line in html
    many = with_endings(make_result(frequency=range(100, 120)), dict.fromkeys(range(40), (6, 20_000.0)), {})
    # both schemes have one error: a text stands once, with its points
    *lines, left = describe_ended(many, 6)
    assert len(lines) == 10
    assert all(";" in line for line in lines)
    assert re.fullmatch(r"and \d+ more points", left)


def test_an_inaccurate_state_is_no_volume_above_rtol():
    """Known to rtol is what its error says, whatever the outcome."""
    result = with_endings(make_result(), {0: (6, 20_000.0)}, {0: "the response is known to 3 % only"})
    assert float(result.errors.flat[0]) < 0.01
    assert not result.above.flat[0]
    known = certainty_of(result)
    assert (known.n_known, known.n_less) == (2, 6)


def test_a_point_at_its_target_is_drawn_where_it_ended():
    """It is computed to the end, with no values at later counts."""
    result = with_endings(make_result(), dict.fromkeys(range(8), (0, 6000.0)), {})
    assert result.last_kept(result.shown_point()) == 2
    caption = draw_figure(result, "worn_profile").caption.replace("\N{NO-BREAK SPACE}", " ")
    assert "5000 cycles" in caption


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
    assert main([str(tmp_path / "old.nc"), "-o", str(tmp_path / "report")]) == 0
    with open_result(tmp_path / "old.nc") as opened:
        assert opened.fretwear.outcomes().values.ravel()[3] == "march_failed"
        assert opened["loop_contact"].values.tolist() == [0, 1]
        assert "error not known" in str(opened.fretwear.summary())
