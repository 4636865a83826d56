"""Mutated inputs of five kinds, and what comes of them: no traceback, no hang, no more than 1 GiB is wanted.

    python -m tests.benchmarks.fuzz_files [COUNT] [--seed SEED] [--kinds report,reader] [--first NUMBER] [--processes N]

The kinds: `text` a study file and `scene` its scene file under `run-study --plan`, `result` a result file there,
`report` one under `study-report`, `reader` one that is opened and asked whatever the accessor answers. Bytes are
changed, and in the last two also whole attributes, values, types and dimensions. An input is known by its seed, its
number and the kinds: `1 --first NUMBER` has it again. Prints what is wrong; exit status 1 where anything is.
"""

import argparse
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.studyrunner.fuzzed import read_mutations, together, write_whole_files

KINDS = ("text", "scene", "result", "report", "reader")
PART = 100  # inputs of a process


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("count", type=int, nargs="?", default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--processes", type=int, default=2)
    options = parser.parse_args()
    kinds = dict.fromkeys(options.kinds.split(","), 1.0)
    last = options.first + options.count
    parts = [range(first, min(first + PART, last)) for first in range(options.first, last, PART)]
    with tempfile.TemporaryDirectory() as name, ThreadPoolExecutor(options.processes) as pool:
        made = Path(name)
        write_whole_files(made)
        running = pool.map(lambda part: read_mutations(made, options.seed, part, kinds), parts)
        found = []
        for part in running:
            found.append(part)
            print(*part.wrong, together(found), sep="\n", flush=True)
    whole = together(found)
    print(f"{len(whole.wrong)} of {whole.statuses.total()} inputs are not answered as they should be")
    return int(bool(whole.wrong) or whole.largest > 2**30)


if __name__ == "__main__":
    sys.exit(main())
