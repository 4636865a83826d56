"""Hands arrays of SHARED_BYTES from rank 0 to all others; to be started by the tests under mpiexec.

Each of the others reads all of them and writes to `<rank>.json` their sum, and what it has of them for itself.
CANNOT_MAP: a rank that does not see the file.
"""

import json
import os
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from studyrunner.mpi import mapped_file
from studyrunner.mpi.mapped_file import MappedFile, hand_out, take_over
from studyrunner.mpi.ranks import start_ranks
from tests.mpi.launching import memory_of_mapping


def refuse(_: MappedFile) -> object:
    raise PermissionError


def share() -> None:
    ranks = start_ranks()
    if str(ranks.rank) == os.environ.get("CANNOT_MAP"):
        mapped_file.open_mapped = refuse
    n_bytes = int(os.environ["SHARED_BYTES"])
    if ranks.rank == 0:
        value, _ = hand_out(ranks, {"ones": np.ones(n_bytes // 8)}, Path("shared").absolute())
    else:
        value = take_over(ranks)
    assert isinstance(value, dict)
    said = {"sum": float(value["ones"].sum()), **memory_of_mapping(str(Path("shared").absolute()))}
    Path(f"{ranks.rank}.json").write_text(json.dumps(said), encoding="utf-8")
    ranks.close()


if __name__ == "__main__":
    share()
