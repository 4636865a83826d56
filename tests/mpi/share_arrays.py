"""Hands arrays of SHARED_BYTES from rank 0 to all others; to be started by the tests under mpiexec.

Each of the others reads all of them and writes to `<rank>.json` their sum, and what it has of them for itself.
CANNOT_MAP: a rank that the system does not let map the memory of others.
"""

import json
import os
import sys
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[2]))

from studyrunner.mpi import broadcast
from studyrunner.mpi.ranks import start_ranks
from studyrunner.mpi.shared_memory import Address
from studyrunner.mpi.version_check import check_versions, report_version
from tests.mpi.launching import memory_of_mapping


def refuse(_: Address) -> object:
    raise PermissionError


def share() -> None:
    ranks = start_ranks()
    if str(ranks.rank) == os.environ.get("CANNOT_MAP"):
        broadcast.open_shared = refuse
    n_bytes = int(os.environ["SHARED_BYTES"])
    if ranks.rank == 0:
        handed = broadcast.Broadcast(ranks, check_versions(ranks), {"ones": np.ones(n_bytes // 8)})
        handed.send()
        value: object = handed.value
    else:
        report_version(ranks)
        value = broadcast.take_over(ranks)
    assert isinstance(value, dict)
    said = {"sum": float(value["ones"].sum()), **memory_of_mapping("fretwear-scene")}
    Path(f"{ranks.rank}.json").write_text(json.dumps(said), encoding="utf-8")
    ranks.close()


if __name__ == "__main__":
    share()
