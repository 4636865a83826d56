"""Mutated inputs of five kinds, and what comes of them: no traceback and no hang is wanted.

    python -m tests.benchmarks.fuzz_files [COUNT [SEED [FIRST [KIND ...]]]]

The kinds are those of `tests.studyrunner.fuzzing`. An input is known by its seed, its number and the kinds: COUNT 1
with its number for FIRST has it again. Prints what is wrong; status 1 where anything is. Random bytes in an HDF5 file
may crash the library, which nothing here prevents: these are counted apart.
"""

import sys
import tempfile
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from itertools import chain
from pathlib import Path

from tests.studyrunner.fuzzing import FILES, answers, write_whole_files

PART = 100  # inputs of a process


def main() -> int:
    count, seed, begin = (int(text) for text in (sys.argv[1:4] + ["10000", "1", "0"][len(sys.argv[1:4]) :]))
    kinds = tuple(sys.argv[4:]) or tuple(FILES)
    parts = [range(first, min(first + PART, begin + count)) for first in range(begin, begin + count, PART)]
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(2) as pool:
        whole = Path(name, "whole")
        whole.mkdir()
        write_whole_files(whole)
        found = list(chain.from_iterable(pool.map(lambda part: answers(whole, seed, part, kinds), parts)))
    crashed = [answer.wrong for answer in found if answer.ended.startswith("ended -")]
    wrong = [answer.wrong for answer in found if answer.wrong and answer.wrong not in crashed]
    print(*wrong, *crashed, *sorted(Counter(answer.ended for answer in found).items()), sep="\n")
    print(f"{len(wrong)} of {count} inputs are not answered as they should be, and {len(crashed)} crash a library")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
