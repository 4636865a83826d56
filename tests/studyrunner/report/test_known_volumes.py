"""What the report says of how well worn volumes are known: bands, bars, marks, sentences; and of older files."""

import numpy as np

from studyrunner.plan.point_text import settings_of as of_study
from studyrunner.report.page.page import write_page
from studyrunner.report.reading.known_volumes import describe_ended, settings_of, tell_ends, tell_volumes
from studyrunner.report.reading.result import Result
from studyrunner.study.study_file import format_study, read_study
from tests.studyrunner.report.figure_cases import make_result, with_endings
from tests.studyrunner.report.figure_numbers import draw_figure

# flat indices: frequency 200, 201, 202, 204 times implicit, explicit; errors 2 % at 202 Hz, 1.3 % beside it
EARLY, ABOVE, SENSITIVE, LOST = 2, 4, 5, 7


def mixed():
    """One point ended early, one is above rtol, one sensitive and one has no state; others are known to rtol or not."""
    endings = {EARLY: (3, 6000.0), ABOVE: (6, 20_000.0), SENSITIVE: (15, 20_000.0)}
    messages = {ABOVE: "from cycle 1000 on the wear rate is known to 2.6 % only", EARLY: "it broke off"}
    return with_endings(make_result(failed=[LOST]), endings, messages)


def test_sentences_begin_with_the_worn_volume(tmp_path):
    result = mixed()
    assert tell_volumes(result) == (
        "The worn volume of 2 of 8 points is known to rtol = 1 %, of 4 less well, 2 not computed to the end; the worst"
        " is known to 2 %, at 202 Hz, implicit scheme. What may help: rtol = 0.005."
    )
    assert tell_ends(result) == (
        "8 points, 6 computed to the end, 1 ended early and hold what was computed until then, 1 without a result."
    )
    write_page(result, [], tmp_path / "index.html")
    html = (tmp_path / "index.html").read_text(encoding="utf-8")
    assert html.index("The worn volume of 2 of 8") < html.index("8 points, 6 computed") < html.index("Above.")
    assert "202 Hz, implicit scheme: from cycle 1000 on the wear rate is known to 2.6 % only" in html


def test_points_are_named_with_cycle_and_error():
    result = mixed()
    assert describe_ended(result, 6) == [
        "202 Hz, implicit scheme: from cycle 1000 on the wear rate is known to 2.6 % only"
    ]
    assert describe_ended(result, 3) == [
        "201 Hz, implicit scheme: computed up to 6000 cycles, worn volume known to 1.3 %, it broke off"
    ]
    many = with_endings(make_result(frequency=range(100, 120)), dict.fromkeys(range(40), (6, 20_000.0)), {})
    lines = describe_ended(many, 6)
    assert (len(lines), lines[-1]) == (11, "and 30 more")


def test_errors_that_were_never_estimated_say_so():
    result = mixed()
    estimates = result.dataset["error_estimate"].copy(deep=True)
    estimates.values.flat[[0, 1]] = np.nan
    unknown = Result(result.path, result.dataset.assign(error_estimate=estimates))
    assert "of 2 it was never estimated" in tell_volumes(unknown)
    none = Result(result.path, result.dataset.assign(error_estimate=estimates * np.nan))
    assert tell_volumes(none) == (
        "The worn volume of 0 of 8 points is known to rtol = 1 %, 2 not computed to the end, of 6 it was never"
        " estimated."
    )


def test_an_inaccurate_state_is_no_volume_above_rtol():
    """Known to rtol is what its error says, whatever the outcome."""
    result = with_endings(make_result(), {0: (6, 20_000.0)}, {0: "the response is known to 3 % only"})
    assert float(result.errors.flat[0]) < 0.01
    assert not result.above.flat[0]
    assert int(result.known.sum()) == 2
    assert "of 2 of 8 points is known to rtol = 1 %, of 6 less well" in tell_volumes(result)


def test_the_report_and_the_run_advise_the_same():
    """Settings of a point by its file are those by its study."""
    changes = ("axes.frequency=[200, 201]", "axes.scheme=['implicit', 'explicit']", "solver.harmonics=5")
    study = read_study("sdof_slider", (*changes, "slow_time.largest_depth=1e-6"))
    made = make_result(frequency=(200.0, 201.0))
    result = Result(made.path, made.dataset.assign_attrs(study=format_study(study)))
    for place in np.ndindex(result.above.shape):
        assert settings_of(result, place) == of_study(study, place)


def test_a_point_at_its_target_is_drawn_where_it_ended():
    """It is computed to the end, with no values at later counts."""
    result = with_endings(make_result(), dict.fromkeys(range(8), (0, 6000.0)), {})
    assert result.last_kept(result.shown_point()) == 2
    caption = draw_figure(result, "worn_profile").caption.replace("\N{NO-BREAK SPACE}", " ")
    assert "5000 cycles" in caption
