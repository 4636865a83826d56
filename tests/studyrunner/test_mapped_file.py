"""Arrays in a file that several processes map, and how an object gets to all ranks."""

import pickle
import queue
import threading

import numpy as np
import pytest

from studies import build_scene
from studyrunner.mpi import mapped_file
from studyrunner.mpi.mapped_file import hand_out, open_mapped, take_over, write_mapped
from studyrunner.scene.scene import describe_scene

THINGS = {"c": np.arange(6.0).reshape(2, 3), "f": np.asfortranarray(np.eye(3)), "none": np.zeros((0, 2)), "n": None}
THINGS["part"] = np.arange(10.0)[::2]


def test_a_scene_is_the_same_with_its_arrays_in_a_file(tmp_path):
    model = build_scene("dovetail_sector", mesh=1, nodal_diameter=3, n_harmonics=3)
    other = open_mapped(write_mapped(model, tmp_path / "model"))
    assert describe_scene(other).digest == describe_scene(model).digest
    stiffness = other.linear[0].stiffness
    assert stiffness.flags.writeable
    assert stiffness.flags.aligned


def test_what_one_writes_is_not_seen_by_others_and_all_layouts_are_kept(tmp_path):
    written = write_mapped(THINGS, tmp_path / "things")
    one, other = open_mapped(written), open_mapped(written)
    one["c"][0, 0] = 7.0
    assert other["c"][0, 0] == 0.0
    written.remove()
    for name in ("f", "none", "part"):
        np.testing.assert_array_equal(other[name], THINGS[name])
    assert other["f"].flags.f_contiguous
    assert other["n"] is None


@pytest.mark.parametrize("seen", ["nothing", "another file", "a part"])
def test_a_file_that_is_not_the_one_that_was_written_is_refused(seen, tmp_path):
    written = write_mapped(THINGS, tmp_path / "things")
    content = written.path.read_bytes()
    written.path.unlink()
    if seen != "nothing":
        written.path.write_bytes(b"0" * len(content) if seen == "another file" else content[:-64])
    with pytest.raises(OSError, match="another file here" if seen != "nothing" else "No such file"):
        open_mapped(written)


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


@pytest.mark.parametrize(
    ("size", "blind", "full"), [(1, "", False), (3, "", False), (4, "13", False), (2, "1", False), (3, "", True)]
)
def test_every_rank_gets_it_with_or_without_the_file(size, blind, full, tmp_path, monkeypatch):
    """blind: ranks that do not see the file. full: whether there is no room for a file."""
    boxes: dict[tuple[int, int], queue.SimpleQueue[bytes]] = {
        (a, b): queue.SimpleQueue() for a in range(size) for b in range(size)
    }
    got: dict[int, dict[str, np.ndarray]] = {}

    def open_here(given):
        if threading.current_thread().name in blind:
            raise PermissionError
        return open_mapped(given)

    def refuse(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(mapped_file, "open_mapped", open_here)
    if full:
        monkeypatch.setattr(mapped_file, "write_mapped", refuse)

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
    got[0], seeing = hand_out(ranks, {"a": np.arange(5.0)}, tmp_path / "file")
    for rank in range(1, size):
        ranks.send("next", rank)
    for thread in others:
        thread.join(timeout=200)
        assert not thread.is_alive()
    expected = {rank for rank in range(1, size) if str(rank) not in blind and not full}
    assert seeing == (expected | {0} if expected else set())
    assert sorted(got) == list(range(size))
    for value in got.values():
        np.testing.assert_array_equal(value["a"], np.arange(5.0))
