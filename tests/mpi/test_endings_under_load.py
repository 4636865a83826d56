"""Runs whose tasks keep the interpreter for seconds, as long calls of C do, end all the same, and soon."""

import contextlib
import os
import signal
import time

from tests.mpi.launching import CHEAP, FAKED, SOON, results, run_to_end

STUDY = [
    *(FAKED, *CHEAP),
    *("--set", "axes.frequency=[100, 110]"),
    *("--set", "axes.wear_coefficient=[0, 5e-12, 1e-11]"),
    *("--set", "axes.scheme=['implicit']"),
    *("-o", "out.nc"),
]
STEPS = 60
"""Steps of a march. In each of them the interpreter is kept from the other threads for a second."""

ENVIRONMENT = {"FAKE_STEPS": str(STEPS), "FAKE_SECONDS": "0.02", "FAKE_HOLDS": "1"}
N_SIGNALS = 200


def wait_for_a_march(running, folder):
    """Until the branch has taken its steps; what is computed then holds the interpreter."""
    steps = folder / "steps.txt"
    assert running.reaches(lambda: steps.exists() and steps.stat().st_size >= 2 * len("step\n")), running.said
    time.sleep(1.0)


def test_two_hundred_signals_end_it_with_a_result(tmp_path):
    began = []

    def terminate(running):
        wait_for_a_march(running, tmp_path)
        rank_0 = running.ranks()[0]
        began.append(time.monotonic())
        for _ in range(N_SIGNALS):
            with contextlib.suppress(ProcessLookupError):
                os.kill(rank_0, signal.SIGTERM)
            time.sleep(0.01)

    ended = run_to_end(2, STUDY, tmp_path, ENVIRONMENT, terminate)
    seconds = time.monotonic() - began[0]
    assert ended.status == 130
    assert ended.said.count("run-study: interrupted: out.nc holds 0 of 6 points, the same command goes on") == 1
    assert "Traceback" not in ended.said
    assert "worn_volume" in results(tmp_path / "out.nc")
    assert seconds < SOON < STEPS


def test_the_launcher_is_gone_with_a_rank(tmp_path):
    def kill(running):
        wait_for_a_march(running, tmp_path)
        memory.update(running.shared_memory())
        os.kill(running.ranks()[1], signal.SIGKILL)

    memory: dict[str, bool] = {}
    ended = run_to_end(2, STUDY, tmp_path, ENVIRONMENT, kill)
    assert ended.status != 0
    assert ended.seconds < SOON
    assert memory
    assert not any(memory.values())


STUCK = """
import sys, time
from studyrunner import run
from studyrunner.checkpoint.store import Store
from studyrunner.system import endings
endings.SECONDS_OF_GRACE = 1.0

def hang(*_, **__):
    print("hangs", file=sys.stderr, flush=True)
    while True:
        time.sleep(600)

Store.tick = hang
from studyrunner.cli import main
sys.exit(main())
"""


def test_one_more_signal_ends_a_run_that_cannot_end(tmp_path):
    """A disk that does not answer, for one."""
    script = tmp_path / "stuck.py"
    script.write_text(STUCK, encoding="utf-8")
    sent = []

    def end_twice(running):
        for seconds in (0.0, 0.2, 2.0):
            running.wait_for("hangs")
            time.sleep(seconds)
            sent.append(running.process.poll())
            running.process.send_signal(signal.SIGTERM)

    ended = run_to_end(0, [str(script), "two_masses", "-o", "out.nc"], tmp_path, {}, end_twice)
    assert sent == [None, None, None]
    assert ended.status == 130
    assert ended.seconds < SOON
    assert "run-study: ended at once: the same command goes on where it was" in ended.said
