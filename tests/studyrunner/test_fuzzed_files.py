"""2000 fuzzed study, scene and result files: no traceback, no hang, at most 1 GB."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

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
AT_ONCE = 2


def test_fuzzed_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["sdof_slider", "--write-scene", "scene.h5"]) == 0
    Path("study").write_text(STUDY, encoding="utf-8")
    small = ("axes.frequency=150", "slow_time.cycles=0", "axes.harmonics=3", "outputs.loops=[]")
    assert main(["study", "-o", "result", *(part for text in small for part in ("--set", text))]) == 0
    shutil.rmtree("result.parts")
    with ThreadPoolExecutor(AT_ONCE) as pool:
        parts = list(pool.map(lambda part: read_mutations(tmp_path, part), range(AT_ONCE)))
    statuses = sum((Counter(part["statuses"]) for part in parts), Counter())
    slowest, largest = (max(part[name] for part in parts) for name in ("slowest", "largest"))
    print(f"{N_FILES} files, {dict(statuses)}, slowest {slowest:.1f} s, {largest / 1e6:.0f} MB")
    assert [wrong for part in parts for wrong in part["wrong"]] == []
    assert statuses.total() == N_FILES
    # most of them are wrong, and not all: those that are would say little otherwise
    for kind in ("text", "scene", "result"):
        assert statuses[f"{kind} 2"] > 100
        assert statuses[f"{kind} 0"] > 20
    assert largest < 2**30


def read_mutations(made: Path, part: int) -> dict[str, Any]:
    """What a process has found that reads its part of the files, in a folder of its own."""
    folder = made / str(part)
    folder.mkdir()
    for name in ("study", "scene.h5", "result"):
        shutil.copy(made / name, folder)
    root = str(Path(__file__).parents[2])
    first, last = (N_FILES * place // AT_ONCE for place in (part, part + 1))
    command = [sys.executable, "-m", "tests.studyrunner.fuzzing", str(folder), "1", str(first), str(last)]
    environment = {**os.environ, "PYTHONPATH": root, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, env=environment, cwd=root, capture_output=True, text=True, check=False)
    at = (folder / "number").read_text(encoding="ascii")
    assert done.returncode == 0, f"ended at {at}: {done.returncode} {done.stderr[-3000:]}"
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found
