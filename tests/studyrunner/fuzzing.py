"""Mutations of valid study, scene and result files, and what the commands make of each, in a process of its own.

Kinds: "text" a study file, "scene" its scene file, "result" a result file, all under `run-study --plan`; "report" a
result file under `study-report`; "reader" one that is opened and asked whatever it can be asked.
"""

import contextlib
import faulthandler
import io
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

from studies import sandboxed_read
from studyrunner import cli
from studyrunner.report.drawing import Drawing, style
from studyrunner.user_error import UserError
from tests.studyrunner.own_time import Stopwatch
from tests.studyrunner.reading_process import read_in_a_fork
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
NASTY = (
    *("nan", "-inf", "1e308", "-5e-324", "0", "-1", "9" * 400, "0x" + "f" * 300, "1e400", "true", "1979-05-27", "[]"),
    *("{}", "[[1]]", '""', '"auto"', '"\\u001b[2J"', "'../../x'", "[1, 'a']", "{start = 1, stop = 2, num = 1e9}", "="),
    *('"default"', "[" * 60 + "]" * 60, "1e9", '"adaptive"', "[nan]", "{start = nan, stop = 2, num = 3}", "\x00", "]"),
    *('"', "#"),
)
FILES = {"text": "study", "scene": "scene.h5", "result": "result", "report": "drawn", "reader": "drawn"}
"""What is mutated of each kind."""
SECONDS = {"text": 5.0, "scene": 5.0, "result": 5.0, "report": 10.0, "reader": 10.0}
PATIENCE = 90
_ROOT = str(Path(__file__).parents[2])


class Answer(NamedTuple):
    """What became of an input. ended: kind and status. wrong: a text where that is not right. bytes: of its memory."""

    ended: str
    wrong: str
    seconds: float = 0.0
    bytes: int = 0


def write_whole_files(folder: Path) -> None:
    """A study, its scene, its result, and a result to draw."""
    scene, study, result = (str(folder / name) for name in ("scene.h5", "study", "result"))
    assert cli.main(["sdof_slider", "--write-scene", scene]) == 0
    Path(study).write_text(STUDY, encoding="utf-8")
    small = ("axes.frequency=150", "slow_time.cycles=0", "axes.harmonics=3", "outputs.loops=[]")
    assert cli.main([study, "-o", result, *(part for text in small for part in ("--set", text))]) == 0
    Path(f"{result}.progress").unlink()
    write_result(folder / "drawn")


def answers(made: Path, seed: int, numbers: range, kinds: tuple[str, ...]) -> list[Answer]:
    """What another process, with a folder of its own, says of the inputs of these numbers."""
    folder = made / f"{numbers.start}"
    folder.mkdir()
    for name in set(FILES.values()):
        shutil.copy(made / name, folder)
    given = [str(folder), str(seed), str(numbers.start), str(numbers.stop), *kinds]
    command = [sys.executable, "-m", __name__, *given]
    environment = {**os.environ, "PYTHONPATH": _ROOT, "OPENBLAS_NUM_THREADS": "1"}
    done = subprocess.run(command, env=environment, cwd=_ROOT, stdout=subprocess.PIPE, text=True, check=True)
    shutil.rmtree(folder)
    return [Answer(*json.loads(line)) for line in done.stdout.splitlines()]


def mutate_text(text: str, chance: random.Random) -> bytes:
    """A study file with values, lines or bytes changed."""
    lines = text.splitlines()
    for _ in range(chance.choice([1, 1, 2, 4])):
        place = chance.randrange(len(lines))
        way = chance.randrange(6)
        if way <= 2 and "=" in lines[place]:
            lines[place] = lines[place].split("=")[0] + "= " + chance.choice(NASTY)
        elif way == 3:
            lines.insert(place, chance.choice(lines))
        elif way == 4 and len(lines) > 1:
            del lines[place]
        else:
            at = chance.randrange(len(lines[place]) + 1)
            lines[place] = lines[place][:at] + chance.choice(NASTY) + lines[place][at:]
    content = "\n".join(lines).encode("utf-8", "surrogatepass")
    return mutate_bytes(content, chance) if chance.random() < 0.2 else content


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
    if kind == "text":
        mutated.write_bytes(mutate_text(whole["study"].decode(), chance))
    # what stands in a result is taken for what it was; under run-study only its study and scene are read
    elif kind not in ("report", "reader") or chance.random() < 0.4:
        mutated.write_bytes(mutate_bytes(whole[FILES[kind]], chance))
    else:
        mutate_result(mutated, chance)


def ask(path: Path) -> int:
    """Opens a result and asks it all that there is to ask; what it does not hold it says by ValueError or KeyError."""
    from studyrunner.accessor import join_results
    from studyrunner.report.reading.result import open_for_report

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


def _lay_out(drawing: Drawing, folder: Path) -> tuple[Path, Path]:
    """As Drawing.save, with everything but the painting, which takes most of the time."""
    with style():
        drawing.figure.draw_without_rendering()
    paths = folder / f"{drawing.name}.svg", folder / f"{drawing.name}.png"
    paths[0].write_text('<svg xmlns="http://www.w3.org/2000/svg"/>', encoding="utf-8")
    return paths


def command_of(kind: str) -> int:
    """Exit status of the command on the files in this folder."""
    from studyrunner.report import cli as report

    if kind == "reader":
        return ask(Path("drawn"))
    if kind == "report":
        return report.main(["drawn", "-o", "report"])
    return cli.main(["result" if kind == "result" else "study", "--plan"])


def _answer(kind: str, name: str) -> Answer:
    """What the command makes of the files in this folder, within the limits of memory."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    own = pages * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (own + 2**31,) * 2)
    largest, waited = 0, 0.0

    def read(arguments: list[str]) -> tuple[int, str]:
        nonlocal largest, waited
        # what this process has already is none of the file's
        found = read_in_a_fork(arguments, own)
        largest, waited = max(largest, found.largest), waited + found.waited
        return found.status, found.said

    sandboxed_read.run_sandbox = read
    before, watch = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, Stopwatch()
    said, printed = io.StringIO(), io.StringIO()
    with contextlib.redirect_stderr(said), contextlib.redirect_stdout(printed):
        try:
            status = command_of(kind)
        except Exception:
            status = 1
            traceback.print_exc()
    seconds, lines = watch.seconds(waited), said.getvalue().splitlines()
    right = (status == 2 and len(lines) == 1 and lines[0].isprintable()) or (status == 0 and not lines)
    right = right and seconds <= SECONDS[kind] and len("".join(lines)) <= 2000 and "\x1b" not in printed.getvalue()
    wrong = "" if right else f"{name}: status {status}, {seconds:.1f} s: {said.getvalue()[-1500:]}"
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    return Answer(f"{kind} {status}", wrong, seconds, 1024 * max(grown, largest))


def answer_in_a_fork(kind: str, name: str, whole: Mapping[str, bytes], chance: random.Random) -> Answer:
    """What becomes of an input, in a copy of this process that no hang and no crash gets out of."""
    receive, send = os.pipe()
    child = os.fork()
    if child == 0:
        signal.alarm(PATIENCE)
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
    wrong = f"{name}: the process ended: {os.waitstatus_to_exitcode(status)}" if made else ""
    return Answer(f"{kind} {'died' if made else 'not made'}", wrong)


def run(folder: str, seed: str, first: str, last: str, *kinds: str) -> None:
    """Prints a line for each input."""
    os.chdir(folder)
    faulthandler.enable()
    sandboxed_read.LONGEST = 1
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
