"""Mutated inputs of the kinds of `tests.studyrunner.fuzzing`: neither a traceback nor a hang is wanted.

    python -m tests.benchmarks.fuzz_files [scene] [result] [deck] [report] [--count 10000] [--seed 1] [--first 0]

An input is known by its seed, its number and the kinds: `--count 1` with its number for `--first` has it again. Random
bytes in an HDF5 file may crash the library, which nothing here prevents: these are counted apart.
"""

import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from pathlib import Path

from tests.benchmarks.frame import arguments
from tests.studyrunner.fuzzing import FILES, answers, write_whole_files

PART = 100  # inputs of a process


def main() -> None:
    """Prints what is wrong, and the endings of all inputs."""
    given = arguments(__doc__, tuple(FILES), count=10_000, seed=1, first=0)
    last = given.first + given.count
    parts = [range(first, min(first + PART, last)) for first in range(given.first, last, PART)]
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(2) as pool:
        whole = Path(name, "whole")
        whole.mkdir()
        write_whole_files(whole)
        pieces = pool.map(lambda part: answers(whole, given.seed, part, tuple(given.chosen)), parts)
        found = list(chain.from_iterable(pieces))
    print(*(answer.wrong for answer in found if answer.wrong), sep="\n")
    print(*sorted(Counter(answer.ended for answer in found).items()), sep="\n")
    crashed = sum(answer.ended.startswith("ended -") for answer in found)
    wrong = sum(bool(answer.wrong) for answer in found) - crashed
    print(f"{wrong} of {given.count} inputs are not answered as they should be, and {crashed} crash a library")


if __name__ == "__main__":
    main()
