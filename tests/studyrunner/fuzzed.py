"""Whole files that are mutated, and processes that read the mutations."""

import json
import os
import shutil
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from studyrunner.cli import main
from tests.studyrunner.result_mutations import write_result

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

_ROOT = str(Path(__file__).parents[2])
_FILES = ("study", "scene.h5", "result", "drawn")


@dataclass(frozen=True)
class Found:
    """What was found in many inputs. statuses: how many of a kind ended how. wrong: a text for each that is not right.

    slowest: s. largest: bytes.
    """

    statuses: Counter[str] = field(default_factory=Counter)
    wrong: tuple[str, ...] = ()
    slowest: float = 0.0
    largest: int = 0

    def __str__(self) -> str:
        """In one line."""
        counts = ", ".join(f"{key}: {number}" for key, number in sorted(self.statuses.items()))
        return f"{self.statuses.total()} inputs, {counts}, slowest {self.slowest:.1f} s, {self.largest / 1e6:.0f} MB"


def together(parts: Iterable[Found]) -> Found:
    """All of them as one."""
    parts = list(parts)
    return Found(
        sum((part.statuses for part in parts), Counter()),
        tuple(wrong for part in parts for wrong in part.wrong),
        max((part.slowest for part in parts), default=0.0),
        max((part.largest for part in parts), default=0),
    )


def write_whole_files(folder: Path) -> None:
    """A study, its scene, its result, and a result to draw."""
    scene, study, result = (str(folder / name) for name in ("scene.h5", "study", "result"))
    assert main(["sdof_slider", "--write-scene", scene]) == 0
    Path(study).write_text(STUDY, encoding="utf-8")
    small = ("axes.frequency=150", "slow_time.cycles=0", "axes.harmonics=3", "outputs.loops=[]")
    assert main([study, "-o", result, *(part for text in small for part in ("--set", text))]) == 0
    Path(f"{result}.progress").unlink()
    write_result(folder / "drawn")


def read_mutations(made: Path, seed: int, numbers: range, kinds: Mapping[str, float]) -> Found:
    """What a process finds in the inputs of these numbers; it is started again where one of them ends it."""
    folder = made / f"{numbers.start}"
    folder.mkdir()
    parts = []
    first = numbers.start
    while first < numbers.stop:
        (folder / "number").unlink(missing_ok=True)
        for name in _FILES:
            shutil.copy(made / name, folder)
        arguments = [str(folder), str(seed), str(first), str(numbers.stop), json.dumps(kinds)]
        done = subprocess.run(
            [sys.executable, "-m", "tests.studyrunner.fuzzing", *arguments],
            env={**os.environ, "PYTHONPATH": _ROOT, "OPENBLAS_NUM_THREADS": "1"},
            cwd=_ROOT,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode == 0:
            said = json.loads(done.stdout.splitlines()[-1])
            parts.append(Found(**{**said, "statuses": Counter(said["statuses"]), "wrong": tuple(said["wrong"])}))
            break
        at = (folder / "number").read_text(encoding="ascii")
        *making, kind, _, number = at.split()
        ended = "not made" if making else str(done.returncode)
        wrong = () if making else (f"{at}: the process ended: {done.returncode} {done.stderr[-1500:]}",)
        parts.append(Found(Counter({"uncounted": int(number) - first, f"{kind} {ended}": 1}), wrong))
        first = int(number) + 1
    shutil.rmtree(folder)
    return together(parts)
