"""Mutations of valid scene, result and deck files, and what the commands make of each.

Kinds: "scene" the scene file of a study, "result" a result file, both under `run-study --plan`; "deck" the deck of a
finite-element model under `run-study --check`; "report" a result file under `study-report`.
"""

import contextlib
import faulthandler
import io
import json
import os
import random
import shutil
import subprocess
import sys
import traceback
from pathlib import Path
from typing import NamedTuple

from studyrunner import cli
from studyrunner.report import cli as report
from tests.studies.fe_models.mutations import mutate

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
NODES = "1,0,0,0\n2,1,0,0\n3,1,1,0\n4,0,1,0\n5,0,0,1\n6,1,0,1\n7,1,1,1\n8,0,1,1\n"
UPPER = "".join(f"{10 + n},{x},{y},{1 + z}\n" for n, x, y, z in (map(int, row.split(",")) for row in NODES.split()))
DECK = f"""*NODE
{NODES}{UPPER}*ELEMENT,TYPE=C3D8I,ELSET=LOW
1,1,2,3,4,5,6,7,8
*ELEMENT,TYPE=C3D8I,ELSET=HIGH
2,11,12,13,14,15,16,17,18
*NSET,NSET=FOOT
1,2,3,4
*NSET,NSET=HEAD,GENERATE
15,18,1
*SURFACE,NAME=UNDER
LOW,S2
*SURFACE,NAME=ABOVE
HIGH,S1
*MATERIAL,NAME=STEEL
*ELASTIC
2.1E11,0.3
*DENSITY
7850.
*SOLID SECTION,ELSET=LOW,MATERIAL=STEEL
*SOLID SECTION,ELSET=HIGH,MATERIAL=STEEL
*SURFACE INTERACTION,NAME=DRY
*FRICTION
0.4
*CONTACT PAIR,INTERACTION=DRY
UNDER,ABOVE
*BOUNDARY
FOOT,1,3
*STEP
*FREQUENCY
4
*END STEP
"""
DECK_STUDY = """
[study]
name = "d"
[scene]
model = "deck.inp"
units = "SI"
load = {set = "HEAD", direction = [1, 0, 0]}
response = {head = {set = "HEAD", direction = [1, 0, 0]}}
preload = [{set = "HEAD", direction = [0, 0, -1], force = 100.0}]
stuck_modes = 6
[axes]
frequency = 100.0
excitation_amplitude = 1.0
[slow_time]
cycles = 0
"""
FILES = {"scene": "scene.h5", "result": "result", "deck": "deck.inp", "report": "result"}
"""What is mutated of each kind."""
PATIENCE = 60
"""Seconds until an input counts as one that hangs; those that are answered take at most 8."""
_ROOT = str(Path(__file__).parents[2])


class Answer(NamedTuple):
    """What became of an input. ended: kind and status, or how the process ended. wrong: a text where it is wrong."""

    ended: str
    wrong: str


def write_whole_files(folder: Path) -> None:
    """A study, its scene and result, and a deck with its study."""
    scene, study, result = (str(folder / name) for name in ("scene.h5", "study", "result"))
    assert cli.main(["sdof_slider", "--write-scene", scene]) == 0
    Path(study).write_text(STUDY, encoding="utf-8")
    small = ("axes.frequency=150", "slow_time.cycles=0", "axes.harmonics=3", "outputs.loops=[]")
    assert cli.main([study, "-o", result, *(part for text in small for part in ("--set", text))]) == 0
    Path(f"{result}.progress").unlink()
    (folder / "deck.inp").write_text(DECK, encoding="utf-8")
    (folder / "deck.toml").write_text(DECK_STUDY, encoding="utf-8")


def answers(made: Path, seed: int, numbers: range, kinds: tuple[str, ...]) -> list[Answer]:
    """What another process, with a folder of its own, says of the inputs of these numbers."""
    found: list[Answer] = []
    environment = {**os.environ, "PYTHONPATH": _ROOT, "OPENBLAS_NUM_THREADS": "1"}
    while len(found) < len(numbers):
        first = numbers.start + len(found)
        folder = shutil.copytree(made, made.with_name(f"{made.name}-{first}"))
        command = [sys.executable, "-m", __name__, str(folder), str(seed), str(first), str(numbers.stop), *kinds]
        done = subprocess.run(command, env=environment, cwd=_ROOT, capture_output=True, text=True, check=False)
        shutil.rmtree(folder)
        found += [Answer(*json.loads(line)) for line in done.stdout.splitlines()]
        if done.returncode:
            # a library has crashed, or it hangs
            place = f"{seed} {numbers.start + len(found)}"
            found.append(Answer(f"ended {done.returncode}", f"{place}: {done.stderr[-1500:]}"))
    return found


def mutate_bytes(content: bytes, chance: random.Random) -> bytes:
    """A file with bits, bytes or blocks changed, most of them where the structure of the file stands; or cut."""
    changed = bytearray(content)
    last = len(changed) if chance.random() < 0.3 else min(len(changed), 8000)
    way = chance.randrange(6)
    if way == 0:
        return bytes(changed[: chance.randrange(len(changed))])
    for _ in range(chance.choice([1, 1, 2, 8, 64])):
        place, source = chance.randrange(max(1, last)), chance.randrange(max(1, last))
        length = chance.choice([1, 2, 4, 8, 64]) if way > 1 else 1
        changed[place : place + length] = {
            1: bytes([changed[place] ^ (1 << chance.randrange(8))]),
            2: chance.randbytes(length),
            3: b"\xff" * length,
            4: bytes(length),
            5: changed[source : source + length],
        }[way]
    return bytes(changed)


def _answer(kind: str, name: str) -> Answer:
    """What the command makes of the files in this folder."""
    said, printed = io.StringIO(), io.StringIO()
    commands = {
        "scene": lambda: cli.main(["study", "--plan"]),
        "result": lambda: cli.main(["result", "--plan"]),
        "deck": lambda: cli.main(["deck.toml", "--check"]),
        "report": lambda: report.main(["result", "-o", "report"]),
    }
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(printed):
        try:
            status = commands[kind]()
        except Exception:
            status = 1
            traceback.print_exc()
    lines = said.getvalue().splitlines()
    shown = all(line.isprintable() and len(line) <= 2000 for line in lines)
    right = bool(lines) and shown if status == 2 else status == 0 and not lines
    right = right and "\x1b" not in printed.getvalue()
    return Answer(f"{kind} {status}", "" if right else f"{name}: status {status}: {said.getvalue()[-1500:]}")


def run(folder: str, seed: str, first: str, last: str, *kinds: str) -> None:
    """Prints a line for each input."""
    os.chdir(folder)
    whole = {name: Path(name).read_bytes() for name in set(FILES.values())}
    for number in range(int(first), int(last)):
        chance = random.Random(f"{seed} {number}")
        kind = chance.choice(kinds)
        for name, content in whole.items():
            Path(name).write_bytes(content)
        good = whole[FILES[kind]]
        wrong = mutate(good, chance.randrange(2**31)) if kind == "deck" else mutate_bytes(good, chance)
        Path(FILES[kind]).write_bytes(wrong)
        faulthandler.dump_traceback_later(PATIENCE, exit=True)
        print(json.dumps(_answer(kind, f"{kind} {seed} {number}")), flush=True)


if __name__ == "__main__":
    run(*sys.argv[1:])
