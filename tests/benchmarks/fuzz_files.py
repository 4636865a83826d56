"""Mutated scene, result and deck files, and what the commands make of them: no traceback and no hang is wanted.

    python -m tests.benchmarks.fuzz_files [--count 10000] [--seed 1] [--first 0]

An input is known by its seed and its number: `--count 1` with its number for `--first` has it again. Random bytes in an
HDF5 file may crash the library, which nothing here prevents: these are counted apart.
"""

import contextlib
import os
import random
import signal
import sys
import tempfile
import traceback
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from studyrunner import cli
from studyrunner.report import cli as report
from tests.benchmarks.frame import arguments
from tests.mpi.launching import options
from tests.studies.fe_models.decks import CUBES, mutate
from tests.studyrunner.small_studies import LAP_JOINT, SLIDER

PATIENCE = 60
"""Seconds until an input counts as one that hangs; those that are answered take at most 8."""

STUDY = SLIDER.replace('"sdof_slider"', '"scene.h5"\nfriction_coefficient = 0.5')
DECK_STUDY = LAP_JOINT.replace("lap.inp", "deck.inp").replace('contact = [["UNDER", "OVER"]]\nclamp = ["GROUND"]\n', "")
DECK_STUDY = DECK_STUDY.replace('"TIP"', '"TOP"').replace('"OVER"', '"TOP"')

KINDS: dict[str, tuple[str, Callable[[], int]]] = {
    "scene": ("scene.h5", lambda: cli.main(["study", "--plan"])),
    "result": ("result", lambda: cli.main(["result", "--plan"])),
    "deck": ("deck.inp", lambda: cli.main(["deck.toml", "--check"])),
    "report": ("result", lambda: report.main(["result", "-o", "report"])),
}
"""What is mutated, and the command that reads it."""


class Answer(NamedTuple):
    """What became of an input. ended: kind and exit status, or the signal. wrong: a text where it is wrong."""

    ended: str
    wrong: str


def write_whole_files() -> None:
    """A study, its scene and result, and a deck with its study, in the current folder."""
    assert cli.main(["sdof_slider", "--write-scene", "scene.h5"]) == 0
    Path("study").write_text(STUDY, encoding="utf-8")
    assert cli.main(["study", "-o", "result", *options("solver.samples=64")]) == 0
    Path("result.progress").unlink()
    Path("deck.inp").write_text(CUBES, encoding="utf-8")
    Path("deck.toml").write_text(DECK_STUDY, encoding="utf-8")


def answer(seed: int, number: int) -> Answer:
    """What another process says of the input of this number; the files are whole before and afterwards."""
    chance = random.Random(f"{seed} {number}")
    kind = chance.choice(list(KINDS))
    name, command = KINDS[kind]
    good = Path(name).read_bytes()
    Path(name).write_bytes(mutate(good, chance.randrange(2**31)) if kind == "deck" else mutate_bytes(good, chance))
    sys.stdout.flush()
    child = os.fork()
    if child == 0:
        _run(command)
    _, ended = os.waitpid(child, 0)
    Path(name).write_bytes(good)
    status, said = os.waitstatus_to_exitcode(ended), Path("said").read_text(errors="replace")
    lines = said.splitlines()
    shown = all(line.isprintable() and len(line) <= 2000 for line in lines)
    right = bool(lines) and shown if status == 2 else status == 0 and not lines
    right = right and "\x1b" not in Path("printed").read_text(errors="replace")
    return Answer(f"{kind} {status}", "" if right else f"{kind} {seed} {number}: status {status}: {said[-1500:]}")


def _run(command: Callable[[], int]) -> None:
    """The command in a child, which ends here."""
    status = 1
    for stream, path in ((1, "printed"), (2, "said")):
        os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), stream)
    sys.stdout, sys.stderr = (os.fdopen(stream, "w", closefd=False) for stream in (1, 2))
    # also within a library
    signal.signal(signal.SIGALRM, signal.SIG_DFL)
    signal.alarm(PATIENCE)
    try:
        status = command()
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)


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


def main() -> None:
    given = arguments(__doc__, count=10_000, seed=1, first=0)
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        write_whole_files()
        found = [answer(given.seed, number) for number in range(given.first, given.first + given.count)]
    print(*(each.wrong for each in found if each.wrong), sep="\n")
    print(*sorted(Counter(each.ended for each in found).items()), sep="\n")
    crashed = sum(each.ended.endswith((f"{-signal.SIGSEGV}", f"{-signal.SIGABRT}")) for each in found)
    wrong = sum(bool(each.wrong) for each in found) - crashed
    print(f"{wrong} of {given.count} inputs are not answered as they should be, and {crashed} crash a library")


if __name__ == "__main__":
    main()
