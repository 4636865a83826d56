"""2000 fuzzed study, scene and result files: no traceback, no hang, at most 1 GB."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from studyrunner.cli import main

STUDY = """
[study]
name = "s"
title = "A study"
[scene]
model = "scene.h5"
friction_coefficient = 0.5
[axes]
frequency = {start = 150.0, stop = 160.0, num = 3}
wear_coefficient = [1e-11, 0]
excitation_amplitude = 10.0
step = [10, 100]
scheme = ["implicit", "explicit"]
sweep = "up"
harmonics = ["auto", 3]
[slow_time]
cycles = 1000
outputs = 3
largest_depth = 1e-7
[solver]
samples = 64
tolerance = 1e-8
time_limit = 10.0
[outputs]
variables = ["default", "outcome"]
loops = [0]
"""

N_FILES = 2000


def test_fuzzed_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, record_property: object) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["sdof_slider", "--write-scene", "scene.h5"]) == 0
    Path("study").write_text(STUDY, encoding="utf-8")
    small = ("axes.frequency=150", "slow_time.cycles=0", "axes.harmonics=3", "outputs.loops=[]")
    assert main(["study", "-o", "result", *(part for text in small for part in ("--set", text))]) == 0
    shutil.rmtree("result.parts")
    root = str(Path(__file__).parents[2])
    command = [sys.executable, "-m", "tests.studyrunner.fuzzing", str(tmp_path), "1", str(N_FILES)]
    environment = {**os.environ, "PYTHONPATH": root, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, env=environment, cwd=root, capture_output=True, text=True, check=False)
    at = Path("number").read_text(encoding="ascii")
    assert done.returncode == 0, f"ended at {at}: {done.returncode} {done.stderr[-3000:]}"
    found = json.loads(done.stdout.splitlines()[-1])
    print(f"{N_FILES} files, {found['statuses']}, slowest {found['slowest']:.1f} s, {found['largest'] / 1e6:.0f} MB")
    assert found["wrong"] == []
    assert sum(found["statuses"].values()) == N_FILES
    # most of them are wrong, and not all: those that are would say little otherwise
    for kind in ("text", "scene", "result"):
        assert found["statuses"][f"{kind} 2"] > 100
        assert found["statuses"][f"{kind} 0"] > 20
    assert found["largest"] < 2**30
