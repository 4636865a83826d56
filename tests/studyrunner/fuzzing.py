"""Mutations of valid study, scene and result files, and what the commands make of them, one after the other.

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
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import xarray as xr

from studies import sandboxed_read
from studyrunner import cli
from studyrunner.report.drawing import Drawing, style
from studyrunner.user_error import UserError
from tests.studyrunner.own_time import Stopwatch
from tests.studyrunner.reading_process import read_in_a_fork
from tests.studyrunner.result_mutations import mutate_result

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
KINDS = {"text": 0.4, "scene": 0.4, "result": 0.2}
"""What is fuzzed in the tests, and how much of it."""

SECONDS = {"text": 5.0, "scene": 5.0, "result": 5.0, "report": 10.0, "reader": 10.0}
PATIENCE = 90
PAINTED = 0.05
"""Share of the reports whose figures are painted as well."""


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
        questions: list[Callable[[], object]] = [
            dataset.fretwear.response,
            lambda: join_results([dataset, dataset]),
            lambda: join_results([dataset], dim="friction_coefficient"),
            *(lambda pair=pair: dataset.fretwear.loop(pair) for pair in dataset["contact"].values.tolist()[:3]),
            *(lambda name=name: dataset.fretwear.flank("wear_depth", name) for name in _surfaces(dataset)),
            *(lambda name=name: dataset[name].load() for name in map(str, dataset.variables)),
        ]
        for question in questions:
            with contextlib.suppress(ValueError, KeyError):
                question()
    return 0


def _surfaces(dataset: xr.Dataset) -> tuple[str, ...]:
    try:
        return tuple(dataset.fretwear.surfaces[:3])
    except KeyError:
        return ()


def _mutate(kind: str, whole: Mapping[str, bytes], chance: random.Random) -> None:
    """Writes the files of one input: all of them, one mutated."""
    content = dict(whole)
    if kind == "text":
        content["study"] = mutate_text(whole["study"].decode(), chance)
    else:
        name = {"scene": "scene.h5", "result": "result"}.get(kind, "drawn")
        # what stands in a result is taken for what it was; under run-study only its study and scene are read
        if name != "drawn" or chance.random() < 0.4:
            content[name] = mutate_bytes(whole[name], chance)
    for name, what in content.items():
        Path(name).write_bytes(what)
    if kind in ("report", "reader") and content["drawn"] is whole["drawn"]:
        mutate_result(Path("drawn"), chance)


def _lay_out(drawing: Drawing, folder: Path) -> tuple[Path, Path]:
    """As Drawing.save, with everything but the painting, which takes most of the time."""
    with style():
        drawing.figure.draw_without_rendering()
    paths = folder / f"{drawing.name}.svg", folder / f"{drawing.name}.png"
    paths[0].write_text('<svg xmlns="http://www.w3.org/2000/svg"/>', encoding="utf-8")
    return paths


def _commands() -> dict[str, Callable[[], int]]:
    from studyrunner.report import cli as report

    return {
        "text": lambda: cli.main(["study", "--plan"]),
        "scene": lambda: cli.main(["study", "--plan"]),
        "result": lambda: cli.main(["result", "--plan"]),
        "report": lambda: report.main(["drawn", "-o", "report"]),
        "reader": lambda: ask(Path("drawn")),
    }


def run(folder: Path, seed: int, numbers: Sequence[int], kinds: Mapping[str, float]) -> dict[str, object]:
    """Statuses and the worst of the files with these numbers; what is wrong with one is in `wrong`."""
    os.chdir(folder)
    largest, waited = 0, 0.0

    def read(arguments: Sequence[str]) -> tuple[int, str]:
        nonlocal largest, waited
        # what this process has already is none of the file's
        found = read_in_a_fork(arguments, address_space())
        largest, waited = max(largest, found.largest), waited + found.waited
        return found.status, found.said

    sandboxed_read.run_sandbox = read
    sandboxed_read.LONGEST = 1
    whole = {name: Path(name).read_bytes() for name in ("study", "scene.h5", "result", "drawn") if Path(name).exists()}
    commands = _commands()
    painted, Drawing.save = Drawing.save, _lay_out  # type: ignore[method-assign]
    for kind in {"report", "reader"} & set(kinds):
        # what it loads is none of the file's either
        assert commands[kind]() == 0
    statuses: dict[str, int] = {}
    wrong: list[str] = []
    slowest = 0.0
    began_with = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    resource.setrlimit(resource.RLIMIT_AS, (address_space() + 2**31,) * 2)
    for number in numbers:
        chance = random.Random(f"{seed} {number}")
        kind = chance.choices(list(kinds), list(kinds.values()))[0]
        # what is made of a file may crash the library that makes it
        Path("number").write_text(f"making {kind} {seed} {number}", encoding="ascii")
        _mutate(kind, whole, chance)
        Drawing.save = painted if chance.random() < PAINTED else _lay_out  # type: ignore[method-assign]
        Path("number").write_text(f"{kind} {seed} {number}", encoding="ascii")
        said, printed = io.StringIO(), io.StringIO()
        # the end of this process, with the place: no hang gets past it
        faulthandler.dump_traceback_later(PATIENCE, exit=True)
        watch, waited = Stopwatch(), 0.0
        with contextlib.redirect_stderr(said), contextlib.redirect_stdout(printed):
            try:
                status = commands[kind]()
            except Exception:
                status = 1
                traceback.print_exc()
        seconds = watch.seconds(waited)
        faulthandler.cancel_dump_traceback_later()
        slowest = max(slowest, seconds)
        lines = said.getvalue().splitlines()
        right = (status == 2 and len(lines) == 1 and lines[0].isprintable()) or (status == 0 and not lines)
        if not right or seconds > SECONDS[kind] or len("".join(lines)) > 2000 or "\x1b" in printed.getvalue():
            wrong.append(f"{kind} {seed} {number}: status {status}, {seconds:.1f} s: {said.getvalue()[-1500:]}")
        key = f"{kind} {status}"
        statuses[key] = statuses.get(key, 0) + 1
    grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - began_with
    return {"statuses": statuses, "wrong": wrong, "slowest": slowest, "largest": 1024 * max(grown, largest)}


if __name__ == "__main__":
    first, last = int(sys.argv[3]), int(sys.argv[4])
    wanted = json.loads(sys.argv[5]) if len(sys.argv) > 5 else KINDS
    print(json.dumps(run(Path(sys.argv[1]), int(sys.argv[2]), range(first, last), wanted)))
