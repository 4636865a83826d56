"""Mutations of valid study, scene, result and deck files, and what the commands make of each, in a copy of a process.

Kinds: "scene" the scene file of a study, "result" a result file, both under `run-study --plan`; "deck" the
deck of a finite-element model under `run-study --check`; "report" a result file under `study-report`; "reader" one that
is opened and asked whatever it can be asked.
"""

import contextlib
import faulthandler
import io
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from studyrunner import cli
from studyrunner.report.drawing import Drawing, style
from studyrunner.user_error import UserError
from tests.studies.fe_models.mutations import mutate
from tests.studyrunner.result_mutations import mutate_result, write_result

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
FILES = {
    "scene": "scene.h5",
    "result": "result",
    "deck": "deck.inp",
    "report": "drawn",
    "reader": "drawn",
}
"""What is mutated of each kind."""
PATIENCE = 20
"""CPU seconds until an input counts as one that hangs, by SIGPROF; those that are answered take at most 8."""
_ROOT = str(Path(__file__).parents[2])


class Answer(NamedTuple):
    """What became of an input. ended: kind and status, or the signal. wrong: a text where that is not right."""

    ended: str
    wrong: str


def write_whole_files(folder: Path) -> None:
    """A study, its scene, its result, and a result to draw."""
    scene, study, result = (str(folder / name) for name in ("scene.h5", "study", "result"))
    assert cli.main(["sdof_slider", "--write-scene", scene]) == 0
    Path(study).write_text(STUDY, encoding="utf-8")
    small = ("axes.frequency=150", "slow_time.cycles=0", "axes.harmonics=3", "outputs.loops=[]")
    assert cli.main([study, "-o", result, *(part for text in small for part in ("--set", text))]) == 0
    Path(f"{result}.progress").unlink()
    write_result(folder / "drawn")
    (folder / "deck.inp").write_text(DECK, encoding="utf-8")
    (folder / "deck.toml").write_text(DECK_STUDY, encoding="utf-8")


def answers(made: Path, seed: int, numbers: range, kinds: tuple[str, ...]) -> list[Answer]:
    """What another process, with a folder of its own, says of the inputs of these numbers."""
    folder = made / f"{numbers.start}"
    folder.mkdir()
    for name in (*set(FILES.values()), "study", "deck.toml"):
        shutil.copy(made / name, folder)
    given = [str(folder), str(seed), str(numbers.start), str(numbers.stop), *kinds]
    command = [sys.executable, "-m", __name__, *given]
    environment = {**os.environ, "PYTHONPATH": _ROOT, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, env=environment, cwd=_ROOT, stdout=subprocess.PIPE, text=True, check=True)
    shutil.rmtree(folder)
    return [Answer(*json.loads(line)) for line in done.stdout.splitlines()]


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


def _mutate(kind: str, whole: Mapping[str, bytes], chance: random.Random) -> None:
    """Writes the files of one input: all of them, one mutated."""
    for name, content in whole.items():
        Path(name).write_bytes(content)
    mutated = Path(FILES[kind])
    if kind == "deck":
        mutated.write_bytes(mutate(whole["deck.inp"], chance.randrange(2**31)))
    # what stands in a result is taken for what it was; under run-study only its study and scene are read
    elif kind not in ("report", "reader") or chance.random() < 0.4:
        mutated.write_bytes(mutate_bytes(whole[FILES[kind]], chance))
    else:
        mutate_result(mutated, chance)


def ask(path: Path) -> int:
    """Opens a result and asks it all that there is to ask; what it does not hold it says by ValueError or KeyError."""
    from studyrunner.accessor import join_results
    from studyrunner.result.view import open_for_report

    try:
        dataset = open_for_report(path).dataset
    except UserError as error:
        print(f"reader: {error}", file=sys.stderr)
        return 2
    with dataset:
        surfaces = []
        with contextlib.suppress(KeyError):
            surfaces = list(dataset.fretwear.surfaces[:3])
        questions: list[Callable[[], object]] = [
            dataset.fretwear.response,
            lambda: join_results([dataset, dataset]),
            lambda: join_results([dataset], dim="friction_coefficient"),
            *(lambda pair=pair: dataset.fretwear.loop(pair) for pair in dataset["contact"].values.tolist()[:3]),
            *(lambda name=name: dataset.fretwear.flank("wear_depth", name) for name in surfaces),
            *(lambda name=name: dataset[name].load() for name in map(str, dataset.variables)),
        ]
        for question in questions:
            with contextlib.suppress(ValueError, KeyError):
                question()
    return 0


def _lay_out(drawing: Drawing, folder: Path) -> tuple[Path]:
    """As Drawing.save, with everything but the painting, which takes most of the time."""
    with style():
        drawing.figure.draw_without_rendering()
    path = folder / f"{drawing.name}.svg"
    path.write_text('<svg xmlns="http://www.w3.org/2000/svg"/>', encoding="utf-8")
    return (path,)


def command_of(kind: str) -> int:
    """Exit status of the command on the files in this folder."""
    from studyrunner.report import cli as report

    if kind == "reader":
        return ask(Path("drawn"))
    if kind == "report":
        return report.main(["drawn", "-o", "report"])
    if kind == "deck":
        return cli.main(["deck.toml", "--check"])
    return cli.main(["result" if kind == "result" else "study", "--plan"])


def _answer(kind: str, name: str) -> Answer:
    """What the command makes of the files in this folder."""
    said, printed = io.StringIO(), io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(printed):
        try:
            status = command_of(kind)
        except Exception:
            status = 1
            traceback.print_exc()
    lines = said.getvalue().splitlines()
    right = (
        bool(lines) and all(line.isprintable() and len(line) <= 2000 for line in lines) if status == 2 else not lines
    )
    right = right and status in (0, 2) and "\x1b" not in printed.getvalue()
    return Answer(f"{kind} {status}", "" if right else f"{name}: status {status}: {said.getvalue()[-1500:]}")


def answer_in_a_fork(kind: str, name: str, whole: Mapping[str, bytes], chance: random.Random) -> Answer:
    """What becomes of an input, in a copy of this process that no hang and no crash gets out of."""
    receive, send = os.pipe()
    child = os.fork()
    if child == 0:
        signal.setitimer(signal.ITIMER_PROF, PATIENCE)
        try:
            # what is made of a file may crash the library that makes it
            _mutate(kind, whole, chance)
            os.write(send, b"made\n")
            os.write(send, json.dumps(_answer(kind, name)).encode())
        finally:
            os._exit(0)
    os.close(send)
    with os.fdopen(receive) as pipe:
        made, _, answer = pipe.read().partition("\n")
    _, status = os.waitpid(child, 0)
    if answer:
        return Answer(*json.loads(answer))
    if not made:
        return Answer(f"{kind} not made", "")
    ended = signal.Signals(-os.waitstatus_to_exitcode(status)).name if status else "nothing"
    return Answer(f"{kind} {ended}", f"{name}: ended by {ended}")


def run(folder: str, seed: str, first: str, last: str, *kinds: str) -> None:
    """Prints a line for each input."""
    os.chdir(folder)
    faulthandler.enable()
    Drawing.save = _lay_out  # type: ignore[method-assign]
    # what a command loads is none of the file's
    with contextlib.redirect_stdout(io.StringIO()):
        assert all(command_of(kind) == 0 for kind in kinds)
    whole = {name: Path(name).read_bytes() for name in set(FILES.values())}
    for number in range(int(first), int(last)):
        chance = random.Random(f"{seed} {number}")
        kind = chance.choice(kinds)
        print(json.dumps(answer_in_a_fork(kind, f"{kind} {seed} {number}", whole, chance)), flush=True)


if __name__ == "__main__":
    run(*sys.argv[1:])
