"""The ranks of a machine have one copy of the scene between them."""

import json

import pytest

from tests.mpi.launching import ROOT, processes_may_share
from tests.mpi.test_ranks import start

SCRIPT = str(ROOT / "tests/mpi/share_arrays.py")
N_BYTES = 64_000_000


def test_ranks_of_a_machine_share_what_is_handed_out(tmp_path):
    """But the last one, which the system does not let map the memory of others."""
    refused = 2
    if not processes_may_share():
        pytest.skip("this system keeps the memory of processes apart")
    environment = {"SHARED_BYTES": str(N_BYTES), "CANNOT_MAP": str(refused)}
    done = start(3, [SCRIPT], tmp_path, environment)
    assert done.returncode == 0, done.stderr
    for rank in range(3):
        said = json.loads((tmp_path / f"{rank}.json").read_text(encoding="utf-8"))
        assert said["sum"] == N_BYTES // 8
        assert said["Anonymous"] == 0
        if rank == refused:
            assert said["Rss"] == 0
        else:
            assert said["Rss"] * 1024 >= N_BYTES
