"""What a user sees while a study runs: a bar on a terminal, a line every half minute elsewhere."""

from __future__ import annotations

import io
import itertools
import re
import time
from collections.abc import Callable, Iterator
from contextlib import redirect_stderr
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.console import Console

from studyrunner import run
from studyrunner.cli import main
from studyrunner.plan.results import Keep, MarchResult, StartResult
from studyrunner.plan.tasks import BranchTask, MarchTask
from studyrunner.scene.scene import describe_scene
from studyrunner.system import progress
from studyrunner.system.progress import ProgressDisplay, Standing
from tests.studyrunner.fakes import fake_evaluate

LINE = re.compile(
    r"\[ *[\d.]+ (?:s|min|h)\] (?P<done>\d+) of (?P<all>\d+) points?, (?P<percent>\d+) %"
    r"(?:, about (?P<left>[\d.]+ (?:s|min|h)) left)?(?:, running: (?P<running>.*))?"
)


class Clock:
    """Stands for `time.monotonic`."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    found = Clock()
    monkeypatch.setattr("studyrunner.system.progress.time.monotonic", found)
    return found


def test_a_line_every_half_minute_at_least(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    looks = []

    def look() -> Standing:
        looks.append(clock.now)
        return Standing(5, 20, 3.0 * (clock.now - 1000.0), ("sweep up to 211 Hz", "210 Hz implicit"))

    with ProgressDisplay() as shown:
        shown.say("marching")
        shown.begin_tasks()
        for tenth in range(36_000):
            clock.now = 1000.0 + 0.1 * tenth
            shown.tick(look)
    first, *lines = capsys.readouterr().err.splitlines()
    assert first == "[    0 s] marching"
    assert lines[0] == ("[    2 s] 5 of 20 points, 25 %, about 6 s left, running: sweep up to 211 Hz, 210 Hz implicit")
    gaps = [later - before for before, later in itertools.pairwise(looks)]
    assert len(lines) == len(looks)
    assert 2.0 - 1e-6 <= min(gaps) <= max(gaps) <= 30.2
    # not more often than that either
    assert len(lines) < 3600 / 30 + 12


def test_what_came_before_the_tasks_does_not_count(clock: Clock, capsys: pytest.CaptureFixture[str]) -> None:
    with ProgressDisplay() as shown:
        shown.say("finding the natural frequencies")
        clock.now += 300.0
        shown.begin_tasks()
        clock.now += 10.0
        shown.tick(lambda: Standing(0, 4, 90.0, ("ramp to 5 Hz",)))
    line = capsys.readouterr().err.splitlines()[-1]
    assert "0 of 4 points, 10 %, about 1.5 min left" in line


def test_all_is_done_at_the_end_only() -> None:
    assert Standing(3, 4, 0.0, ()).fraction(50.0) == 0.99
    assert Standing(4, 4, 0.0, ()).fraction(50.0) == 1.0
    assert Standing(4, 4, 0.0, ()).describe(1.0) == "4 of 4 points, 100 %"
    assert Standing(0, 4, 0.0, ()).fraction(0.0) < 0.01


@given(
    st.lists(
        st.tuples(st.integers(0, 9), st.integers(9, 12), st.floats(0.0, 1e9), st.floats(0.0, 1e4)),
        min_size=2,
        max_size=30,
    )
)
def test_the_percent_that_is_shown_never_falls(reports: list[tuple[int, int, float, float]]) -> None:
    """Whatever is expected, found out to be left, taken back from a rank that is lost, and whenever that is told."""
    clock, shown = Clock(), io.StringIO()
    with pytest.MonkeyPatch.context() as patch, redirect_stderr(shown):
        patch.setattr("studyrunner.system.progress.time.monotonic", clock)
        display = ProgressDisplay()
        display.begin_tasks()
        for n_done, n_points, left, seconds in reports:
            clock.now += progress.LONGEST_SILENCE + seconds
            display.tick(lambda told=(n_done, n_points, left): Standing(*told, ()))  # type: ignore[misc]
    percents = [int(found["percent"]) for found in map(LINE.match, shown.getvalue().splitlines()) if found]
    assert len(percents) == len(reports)
    assert percents == sorted(percents)
    assert percents[-1] <= 100


def test_of_many_tasks_some_are_named() -> None:
    names = tuple(f"{place} Hz implicit" for place in range(64))
    assert (
        Standing(0, 99, 1.0, names)
        .describe(1.0)
        .endswith("running: 0 Hz implicit, 1 Hz implicit, 2 Hz implicit and 61 more")
    )


def test_a_bar_on_a_terminal(clock: Clock, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    screen = io.StringIO()
    looks = []

    def look() -> Standing:
        looks.append(clock.now)
        return Standing(5, 20, 30.0, ("210 Hz implicit",))

    monkeypatch.setattr(progress, "Console", lambda **_: Console(file=screen, force_terminal=True, width=160))
    with ProgressDisplay() as shown:
        shown.say("marching")
        shown.begin_tasks()
        for _ in range(1000):
            clock.now += 0.01
            shown.tick(look)
        assert shown._bar is not None
        shown._bar.refresh()
    assert capsys.readouterr().err == ""
    seen = screen.getvalue()
    assert "0%" in seen
    assert "25%" in seen
    assert "5 of 20 points, 25 %, about 30 s left, running: 210 Hz implicit" in seen
    # a look costs something, a tick does not
    assert 90 <= len(looks) <= 101


def build_slow(model: object, *_: object) -> Callable[..., Iterator[StartResult | MarchResult]]:
    """The stand-in for the solver; each start state and each march takes a while."""
    facts = describe_scene(model)

    def evaluate(task: BranchTask | MarchTask, keep: Keep) -> Iterator[StartResult | MarchResult]:
        for result in fake_evaluate(task, keep, facts):
            time.sleep(0.15)
            yield result

    return evaluate


@pytest.mark.parametrize("compiles", [True, False])
def test_a_run_that_has_to_compile_says_so_once(
    compiles: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(run, "build_evaluator", build_slow)
    numbers = itertools.count(3) if compiles else itertools.repeat(3)
    monkeypatch.setattr(run, "n_compiled", lambda: next(numbers))
    assert main(["sdof_slider", "--set", "axes.frequency=100", "-o", str(tmp_path / "out.nc")]) == 0
    said = capsys.readouterr().err
    assert said.count("the solver is compiled for this machine, once after an installation") == int(compiles)
