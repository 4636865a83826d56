"""Arrays that several processes share, and how an object gets to all ranks of several machines."""

import pickle
import queue
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from studies import build_scene
from studyrunner.mpi import broadcast
from studyrunner.mpi.broadcast import Broadcast, take_over
from studyrunner.mpi.shared_memory import SharedObject, open_shared
from studyrunner.mpi.version_check import Machine
from studyrunner.scene.scene import describe_scene
from tests.mpi.launching import processes_may_share

pytestmark = pytest.mark.processes

ROOT = Path(__file__).parents[2]

READER = """
import pickle, sys
sys.path.insert(0, {root!r})
from studyrunner.mpi.shared_memory import open_shared
thing = open_shared(pickle.loads(sys.stdin.buffer.read({length})))
print("there", flush=True)
sys.stdin.buffer.read()
print(float(thing["a"].sum()), flush=True)
"""

OWNER = """
import pickle, sys, time
sys.path.insert(0, {root!r})
import numpy as np
from studyrunner.mpi.shared_memory import SharedObject
shared = SharedObject(dict(a=np.arange(100000.0)))
sys.stdout.buffer.write(pickle.dumps(shared.address))
sys.stdout.flush()
time.sleep(600)
"""


def test_a_scene_is_the_same_with_its_arrays_in_shared_memory():
    model = build_scene("dovetail_sector", mesh=1, nodal_diameter=3, n_harmonics=3)
    shared = SharedObject(model)
    other = open_shared(shared.address)
    assert describe_scene(shared.value).digest == describe_scene(other).digest == describe_scene(model).digest
    stiffness = shared.value.linear[0].stiffness
    assert stiffness.flags.writeable
    assert stiffness.flags.aligned
    assert not np.shares_memory(stiffness, model.linear[0].stiffness)
    shared.close()


def test_what_one_writes_is_not_seen_by_others_and_all_layouts_are_kept():
    things = {"c": np.arange(6.0).reshape(2, 3), "f": np.asfortranarray(np.eye(3)), "none": np.zeros((0, 2)), "n": None}
    things["part"] = np.arange(10.0)[::2]
    shared = SharedObject(things)
    shared.value["c"][0, 0] = 7.0
    other = open_shared(shared.address)
    assert other["c"][0, 0] == 0.0
    for name in ("f", "none", "part"):
        np.testing.assert_array_equal(other[name], things[name])
    assert other["f"].flags.f_contiguous
    assert other["n"] is None
    shared.close()


def test_the_memory_stays_with_those_who_have_it_when_its_owner_is_killed():
    if not processes_may_share():
        pytest.skip("this system keeps the memory of processes apart")
    with subprocess.Popen([sys.executable, "-c", OWNER.format(root=str(ROOT))], stdout=subprocess.PIPE) as owner:
        assert owner.stdout is not None
        address = pickle.dumps(pickle.load(owner.stdout))
        reader = READER.format(root=str(ROOT), length=len(address))
        command = [sys.executable, "-c", reader]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
            other.stdin.write(address)
            other.stdin.flush()
            assert other.stdout.readline() == b"there\n"
            owner.send_signal(signal.SIGKILL)
            owner.wait(timeout=200)
            other.stdin.close()
            assert float(other.stdout.readline()) == 99999.0 * 50000.0
        with pytest.raises(FileNotFoundError):
            open_shared(pickle.loads(address))


class Threads:
    """Ranks that are threads of one process."""

    def __init__(self, rank, boxes):
        self.rank, self._boxes = rank, boxes
        self.size = 1 + max(rank for rank, _ in boxes)

    def send(self, message, rank):
        self._boxes[self.rank, rank].put(pickle.dumps(message))

    def flush(self):
        pass

    def receive(self, rank=None):
        for source in range(self.size) if rank is None else [rank]:
            box = self._boxes[source, self.rank]
            if not box.empty():
                return source, pickle.loads(box.get())
        return None

    def close(self):
        pass

    def abort(self, status):
        raise AssertionError(status)


def hand_to_all(monkeypatch, hosts, refused=""):
    """What each rank gets, one letter a rank for the machine it is on; how often the memory of others was mapped."""
    size = len(hosts)
    boxes: dict[tuple[int, int], queue.SimpleQueue[bytes]] = {
        (a, b): queue.SimpleQueue() for a in range(size) for b in range(size)
    }
    machines = {rank: Machine(host, "boot", "processes") for rank, host in enumerate(hosts)}
    got: dict[int, object] = {}
    mapped: list[str] = []

    def open_here(address):
        if threading.current_thread().name in refused:
            raise PermissionError
        mapped.append(threading.current_thread().name)
        return open_shared(address)

    monkeypatch.setattr(broadcast, "open_shared", open_here)

    def follow(rank):
        ranks = Threads(rank, boxes)
        got[rank] = take_over(ranks)
        # what rank 0 sends next is still there
        while (message := ranks.receive(0)) is None:
            pass
        assert message == (0, "next")

    others = [threading.Thread(target=follow, args=(rank,), name=str(rank)) for rank in range(1, size)]
    for thread in others:
        thread.start()
    ranks = Threads(0, boxes)
    handed = Broadcast(ranks, machines, {"a": np.arange(5.0)})
    handed.send()
    got[0] = handed.value
    for rank in range(1, size):
        ranks.send("next", rank)
    for thread in others:
        thread.join(timeout=200)
        assert not thread.is_alive()
    return got, len(mapped)


@pytest.mark.parametrize(
    ("hosts", "refused", "n_mapped"),
    [("a", "", 0), ("aaa", "", 2), ("abc", "", 0), ("abbabb", "", 4), ("abbabb", "25", 2)],
)
def test_every_rank_gets_it_and_those_of_a_machine_share(monkeypatch, hosts, refused, n_mapped):
    got, mapped = hand_to_all(monkeypatch, hosts, refused)
    assert mapped == n_mapped
    assert sorted(got) == list(range(len(hosts)))
    for value in got.values():
        assert isinstance(value, dict)
        np.testing.assert_array_equal(value["a"], np.arange(5.0))
