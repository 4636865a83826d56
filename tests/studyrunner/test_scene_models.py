"""Models of several scenes: which rank is sent one, in shared memory or by itself, and how long they are kept."""

import pytest

from solver.model import ReducedModel
from studies import build_scene
from studyrunner.mpi.shared_memory import Address, open_shared
from studyrunner.plan.planning import build_tasks
from studyrunner.plan.tasks import BranchTask
from studyrunner.scene.scene import describe_scene
from studyrunner.scene_models import SceneModels
from studyrunner.study.study_file import read_study

STIFFNESSES = (1.6e5, 1.7e5, 1.8e5)


class Sent:
    """What ranks 0 and 1, which share memory, and rank 2 get with tasks of three scenes."""

    def __init__(self):
        study = read_study("sdof_slider", [f"axes.stiffness={list(STIFFNESSES)}"])
        self.branches = {branch.joint.scene: branch for branch in build_tasks(study, 2).branches}
        self.models = [build_scene("sdof_slider", stiffness=stiffness) for stiffness in STIFFNESSES]
        self.read: list[int] = []
        self._handed = SceneModels(self._read, {0, 1})

    def _read(self, scene):
        self.read.append(scene)
        return self.models[scene]

    def __call__(self, rank, scene):
        task = self._handed.with_model(rank, self.branches[scene])
        assert isinstance(task, BranchTask)
        return task.models[0] if task.models else None


def test_ranks_that_share_memory_get_one_copy_and_others_their_own():
    sent = Sent()
    first, second = sent(0, 1), sent(1, 1)
    assert isinstance(first, Address)
    assert first == second
    assert sent.read == [1]
    model = open_shared(first)
    assert isinstance(model, ReducedModel)
    assert describe_scene(model).digest == describe_scene(sent.models[1]).digest
    assert sent(1, 1) is None
    assert sent(2, 1) is sent.models[1]
    assert sent(2, 1) is None


def test_a_copy_is_closed_once_no_rank_of_the_machine_holds_it():
    sent = Sent()
    address = sent(0, 0)
    assert isinstance(address, Address)
    assert sent(1, 0) == address
    for scene in (1, 2):
        sent(0, scene)
    assert open_shared(address) is not None, "rank 1 may not have opened it yet"
    for scene in (1, 2):
        assert isinstance(sent(1, scene), Address)
    with pytest.raises(OSError, match=r"No such file|another file"):
        open_shared(address)
    assert sent.read == [0, 1, 2]
    assert isinstance(sent(0, 0), Address)
    assert sent.read == [0, 1, 2, 0]
