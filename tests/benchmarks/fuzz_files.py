"""Mutated inputs of five kinds, and what comes of them: no traceback, no hang, no more than 1 GiB is wanted.

    python -m tests.benchmarks.fuzz_files [COUNT [SEED [FIRST [KIND ...]]]]

The kinds: `text` a study file and `scene` its scene file under `run-study --plan`, `result` a result file there,
`report` one under `study-report`, `reader` one that is opened and asked whatever the accessor answers. Bytes are
changed, and in the last two also whole attributes, values, types and dimensions. An input is known by its seed, its
number and the kinds: COUNT 1 with its number for FIRST has it again. Prints what is wrong; status 1 where anything is.
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
        write_whole_files(Path(name))
        found = list(chain.from_iterable(pool.map(lambda part: answers(Path(name), seed, part, kinds), parts)))
    wrong, largest = [answer.wrong for answer in found if answer.wrong], max(answer.bytes for answer in found)
    print(*wrong, *sorted(Counter(answer.ended for answer in found).items()), sep="\n")
    print(f"slowest {max(answer.seconds for answer in found):.1f} s, {largest / 1e6:.0f} MB")
    print(f"{len(wrong)} of {count} inputs are not answered as they should be")
    return int(bool(wrong) or largest > 2**30)


if __name__ == "__main__":
    sys.exit(main())
