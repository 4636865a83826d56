"""What a user sees while a study runs: a bar on a terminal, a line every half minute elsewhere."""

import io
import itertools
import re
import sys
import time

import pytest

from studyrunner import task_runs
from studyrunner.cli import main
from studyrunner.scene.scene import describe_scene
from studyrunner.system.progress import ProgressDisplay, Standing
from tests.studyrunner.fakes import fake_evaluate

LINE = re.compile(
    r"\[ *[\d.]+ (?:s|min|h)\] (?P<done>\d+) of (?P<all>\d+) points?, (?P<percent>\d+) %"
    r"(?:, about (?P<left>[\d.]+ (?:s|min|h)) left)?(?:, running: (?P<running>.*))?"
)


class Clock:
    """Stands for `time.monotonic`."""

    def __init__(self):
        self.now = 1000.0

    def __call__(self):
        return self.now


@pytest.fixture
def clock(monkeypatch):
    found = Clock()
    monkeypatch.setattr("studyrunner.system.progress.time.monotonic", found)
    return found


def test_a_line_every_half_minute_at_least(clock, capsys):
    looks = []

    def look():
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


class Screen(io.StringIO):
    """Stands for a terminal."""

    def isatty(self):
        return True


def test_a_bar_on_a_terminal(clock, monkeypatch):
    screen = Screen()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "160")
    looks = []

    def look():
        looks.append(clock.now)
        return Standing(5, 20, 30.0, ("210 Hz implicit",))

    with ProgressDisplay() as shown:
        shown.say("marching")
        shown.begin_tasks()
        for _ in range(1000):
            clock.now += 0.01
            shown.tick(look)
        shown._bar.refresh()
    seen = screen.getvalue()
    assert "0%" in seen
    assert "25%" in seen
    assert "5 of 20 points, 25 %, about 30 s left, running: 210 Hz implicit" in seen
    # a look costs something, a tick does not
    assert 90 <= len(looks) <= 101


def build_slow(model, *_):
    """The stand-in for the solver; each start state and each march takes a while."""
    facts = describe_scene(model)

    def evaluate(task, keep):
        for result in fake_evaluate(task, keep, facts):
            time.sleep(0.15)
            yield result

    return evaluate


@pytest.mark.parametrize("compiles", [True, False])
def test_a_run_that_has_to_compile_says_so_once(compiles, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(task_runs, "build_evaluator", build_slow)
    numbers = itertools.count(3) if compiles else itertools.repeat(3)
    monkeypatch.setattr(task_runs, "n_compiled", lambda: next(numbers))
    assert main(["sdof_slider", "--set", "axes.frequency=100", "-o", str(tmp_path / "out.nc")]) == 0
    said = capsys.readouterr().err
    assert said.count("the solver is compiled for this machine, once after an installation") == int(compiles)
