"""Arrays in a file that several processes map, and which ranks see such files."""

import numpy as np
import pytest

from studies import build_scene
from studyrunner.mpi import mapped_file
from studyrunner.mpi.mapped_file import open_mapped, ranks_that_see, write_mapped
from studyrunner.scene.scene import describe_scene


def test_a_scene_is_the_same_with_its_arrays_in_a_file(tmp_path):
    model = build_scene("sdof_slider")
    other = open_mapped(write_mapped(model, tmp_path / "model"))
    assert describe_scene(other).digest == describe_scene(model).digest


def test_what_one_writes_is_not_seen_by_others_and_all_layouts_are_kept(tmp_path):
    given = {"c": np.arange(6.0).reshape(2, 3), "f": np.asfortranarray(np.eye(3)), "none": np.zeros((0, 2)), "n": None}
    given["part"] = np.arange(10.0)[::2]
    written = write_mapped(given, tmp_path / "things")
    one, other = open_mapped(written), open_mapped(written)
    one["c"][0, 0] = 7.0
    assert other["c"][0, 0] == 0.0
    written.remove()
    for name in ("f", "none", "part"):
        np.testing.assert_array_equal(other[name], given[name])
    assert other["c"].flags.aligned
    assert other["f"].flags.f_contiguous
    assert other["n"] is None


class Blind:
    """Ranks of which some do not see a file."""

    rank = 0

    def __init__(self, size, blind):
        self.size, self._blind = size, blind
        self._answers = []

    def send(self, message, rank):
        self._answers.append((rank, message.answer() and rank not in self._blind))

    def receive(self):
        return self._answers.pop(0)


@pytest.mark.parametrize(("size", "blind", "expected"), [(1, (), ()), (3, (), (1, 2)), (4, (1, 3), (2,))])
def test_ranks_that_see_a_file_are_found_and_the_file_goes(size, blind, expected, tmp_path, monkeypatch):
    assert ranks_that_see(Blind(size, blind), tmp_path / "file") == frozenset(expected)
    assert list(tmp_path.iterdir()) == []

    def create(path):
        path.touch()
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(mapped_file, "create", create)
    assert ranks_that_see(Blind(size, ()), tmp_path / "file") == frozenset()
    assert list(tmp_path.iterdir()) == []
