"""Mutations of valid study, scene and result files, and what `run-study --plan` makes of them, one after the other."""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import resource
import signal
import sys
from collections.abc import Sequence
from pathlib import Path

from studies import vetting
from studyrunner import cli
from tests.studyrunner.own_time import Stopwatch
from tests.studyrunner.reading_process import read_in_a_fork

NASTY = (
    *("nan", "-inf", "1e308", "-5e-324", "0", "-1", "9" * 400, "0x" + "f" * 300, "1e400", "true", "1979-05-27", "[]"),
    *(
        "{}",
        "[[1]]",
        '""',
        '"auto"',
        '"\\u001b[2J"',
        "'../../x'",
        "[1, 'a']",
        "{start = 1, stop = 2, num = 1e9}",
        '"default"',
    ),
    *(
        "[" * 60 + "]" * 60,
        "1e9",
        '"adaptive"',
        "[nan]",
        "{start = nan, stop = 2, num = 3}",
        "\x00",
        "]",
        "=",
        '"',
        "#",
    ),
)
SECONDS = 5.0
PATIENCE = 240


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
    content = bytearray("\n".join(lines).encode("utf-8", "surrogatepass"))
    if chance.random() < 0.2:
        content = bytearray(mutate_bytes(bytes(content), chance))
    return bytes(content)


def mutate_bytes(content: bytes, chance: random.Random) -> bytes:
    """A file with bits, bytes or blocks changed, most of them where the structure of the file stands; or cut."""
    changed = bytearray(content)
    last = len(changed) if chance.random() < 0.3 else min(len(changed), 8000)
    way = chance.randrange(6)
    if way == 0:
        return bytes(changed[: chance.randrange(len(changed))])
    for _ in range(chance.choice([1, 1, 2, 8, 64])):
        place = chance.randrange(max(1, last))
        length = chance.choice([1, 2, 4, 8, 64])
        if way == 1:
            changed[place : place + 1] = bytes([changed[place] ^ (1 << chance.randrange(8))]) if changed else b""
        elif way == 2:
            changed[place : place + length] = chance.randbytes(length)
        elif way == 3:
            changed[place : place + length] = b"\xff" * length
        elif way == 4:
            changed[place : place + length] = bytes(length)
        else:
            source = chance.randrange(max(1, last))
            changed[place : place + length] = changed[source : source + length]
    return bytes(changed)


def address_space() -> int:
    """Bytes that this process has set aside."""
    pages = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0])
    return pages * resource.getpagesize()


def run(folder: Path, seed: int, numbers: Sequence[int]) -> dict[str, object]:
    """Statuses and the worst of the files with these numbers; what is wrong with one is in `wrong`."""
    os.chdir(folder)
    largest, waited = 0, 0.0

    def read(arguments: Sequence[str]) -> tuple[int, str]:
        nonlocal largest, waited
        # what this process has already is none of the file's
        found = read_in_a_fork(arguments, address_space())
        largest, waited = max(largest, found.largest), waited + found.waited
        return found.status, found.said

    vetting.run_reader = read
    vetting.LONGEST = 1
    study, scene, result = (Path(name).read_bytes() for name in ("study", "scene.h5", "result"))
    statuses: dict[str, int] = {}
    wrong: list[str] = []
    slowest = 0.0
    began_with = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    resource.setrlimit(resource.RLIMIT_AS, (address_space() + 2**31,) * 2)
    for number in numbers:
        chance = random.Random(f"{seed} {number}")
        kind = chance.choices(["text", "scene", "result"], [0.4, 0.4, 0.2])[0]
        Path("study").write_bytes(mutate_text(study.decode(), chance) if kind == "text" else study)
        Path("scene.h5").write_bytes(mutate_bytes(scene, chance) if kind == "scene" else scene)
        Path("result").write_bytes(mutate_bytes(result, chance) if kind == "result" else result)
        Path("number").write_text(f"{kind} {seed} {number}", encoding="ascii")
        said, printed = io.StringIO(), io.StringIO()
        signal.alarm(PATIENCE)  # the end of this process: no hang gets past it
        watch, waited = Stopwatch(), 0.0
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(printed):
            status = cli.main(["result" if kind == "result" else "study", "--plan"])
        seconds = watch.seconds(waited)
        signal.alarm(0)
        slowest = max(slowest, seconds)
        lines = said.getvalue().splitlines()
        right = (status == 2 and len(lines) == 1 and lines[0].isprintable()) or (status == 0 and not lines)
        if not right or seconds > SECONDS or len("".join(lines)) > 2000 or "\x1b" in printed.getvalue():
            wrong.append(f"{kind} {seed} {number}: status {status}, {seconds:.1f} s: {said.getvalue()[-1500:]}")
        key = f"{kind} {status}"
        statuses[key] = statuses.get(key, 0) + 1
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - began_with
    return {"statuses": statuses, "wrong": wrong, "slowest": slowest, "largest": 1024 * max(grown, largest)}


if __name__ == "__main__":
    first, last = int(sys.argv[3]), int(sys.argv[4])
    print(json.dumps(run(Path(sys.argv[1]), int(sys.argv[2]), range(first, last))))
