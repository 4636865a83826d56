"""For how many harmonics a scene is built, and how many one can be solved with, where their number is automatic."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from solver.model import ReducedModel, needed_nodal_diameters
from studies import build_scene
from studies.scene_file import write_scene
from studyrunner.cli import main
from studyrunner.kinds.kind import build_tasks
from studyrunner.mpi.mapped_file import MappedFile, open_mapped
from studyrunner.scene.scene import (
    build_study_scene,
    describe_scene,
    largest_harmonics,
    write_study_scene,
)
from studyrunner.scene_building import SceneModels
from studyrunner.study.study_file import format_study, read_study
from studyrunner.user_error import UserError
from tests.studies.scene_models import plain, sector

WAVE = ("scene.mesh=1", "scene.nodal_diameter=3", "scene.stuck_modes=2", "scene.stress_stiffening=false")
STUDY = """
[study]
name = "s"
[scene]
model = "wave.h5"
friction_coefficient = 0.3
[axes]
frequency = 200.0
"""


def holding(model, n_harmonics):
    """The model with the nodal diameters that this number of harmonics needs, and no others."""
    needed = needed_nodal_diameters(model.nodal_diameter, model.n_sectors, n_harmonics)
    filled = next(iter(model.linear.values()))
    return replace(model, linear={k: model.linear.get(k, filled) for k in needed})


@pytest.mark.parametrize("n_harmonics", [1, 2, 5])
def test_nodal_diameters_that_are_held_bound_the_harmonics(n_harmonics):
    wave = replace(sector(), n_sectors=47, nodal_diameter=4)
    assert largest_harmonics(holding(wave, n_harmonics)) == n_harmonics


@pytest.fixture(scope="module")
def wave_scene(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "wave.h5"
    write_scene(holding(build_study_scene(read_study("dovetail", WAVE)), 3), path)
    return path


@pytest.fixture
def wave_file(wave_scene, tmp_path, monkeypatch):
    """Study of a scene file with the nodal diameters of 3 harmonics."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(wave_scene, tmp_path)
    (tmp_path / "s.toml").write_text(STUDY, encoding="utf-8")
    return "s.toml"


@pytest.mark.slow
def test_automatic_harmonics_go_as_far_as_the_scene_file(wave_file, capsys):
    assert describe_scene(build_study_scene(read_study(wave_file))).largest_harmonics == 3
    assert main([wave_file, "--plan"]) == 0
    assert "harmonics automatic (at most 3, for which the scene holds the nodal diameters)" in capsys.readouterr().out


@pytest.mark.parametrize("override", ["solver.harmonics=4", "axes.harmonics=['auto', 4]"])
def test_a_number_of_harmonics_needs_its_nodal_diameters(override, wave_file):
    with pytest.raises(UserError, match=r"wave\.h5: nd/12: missing: give this group, .* fewer than 4 harmonics"):
        build_study_scene(read_study(wave_file, [override]))


@pytest.fixture
def rough_file(tmp_path, monkeypatch):
    """Study of a scene file with a friction coefficient for each pair."""
    monkeypatch.chdir(tmp_path)
    model = plain()
    own = np.array([0.2, 0.3, 0.4])
    write_scene(replace(model, contact=replace(model.contact, friction_coefficient=own)), tmp_path / "wave.h5")
    (tmp_path / "s.toml").write_text(STUDY.replace("friction_coefficient = 0.3\n", ""), encoding="utf-8")
    return "s.toml"


@pytest.mark.slow
def test_a_scene_file_gives_each_pair_its_friction_coefficient(rough_file):
    study = read_study(rough_file)
    assert study.friction_coefficient is None
    assert build_study_scene(study).contact.friction_coefficient.tolist() == [0.2, 0.3, 0.4]
    assert "friction_coefficient" not in format_study(study)
    write_study_scene(study, Path("again.h5"))
    again = build_study_scene(read_study(rough_file, ["scene.model=again.h5"]))
    assert describe_scene(again).digest == describe_scene(build_study_scene(study)).digest


def test_the_friction_coefficient_is_given_once(rough_file, capsys):
    assert main([rough_file, "--plan", "--set", "scene.friction_coefficient=0.3"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "s.toml: scene.friction_coefficient = 0.3: remove it" in line
    assert "contact/friction_coefficient" in line
    write_scene(plain(), Path("wave.h5"))
    assert main([rough_file, "--plan"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "s.toml: scene.friction_coefficient" in line
    assert "missing: give it, or contact/friction_coefficient in the scene file" in line


STIFFNESSES = (1.6e5, 1.7e5, 1.8e5)


class Sent:
    """What ranks 0 and 1, which see the files, and rank 2 get with tasks of three scenes."""

    def __init__(self, folder):
        study = read_study("sdof_slider", [f"axes.stiffness={list(STIFFNESSES)}"])
        self.sweeps = {sweep.joint.scene: sweep for sweep in build_tasks(study, 2).sweeps}
        self.models = [build_scene("sdof_slider", stiffness=stiffness) for stiffness in STIFFNESSES]
        self.read: list[int] = []
        self._handed = SceneModels(self._read, {0, 1}, folder / "out.nc.progress")

    def _read(self, scene):
        self.read.append(scene)
        return self.models[scene]

    def __call__(self, rank, scene):
        task = self._handed.with_model(rank, self.sweeps[scene])
        return task.models[0] if task.models else None


def test_ranks_that_see_the_files_get_one_copy_and_others_their_own(tmp_path):
    sent = Sent(tmp_path)
    first, second = sent(0, 1), sent(1, 1)
    assert isinstance(first, MappedFile)
    assert first == second
    assert sent.read == [1]
    model = open_mapped(first)
    assert isinstance(model, ReducedModel)
    assert describe_scene(model).digest == describe_scene(sent.models[1]).digest
    assert sent(1, 1) is None
    assert sent(2, 1) is sent.models[1]
    assert sent(2, 1) is None


def test_a_file_goes_once_no_rank_holds_its_model(tmp_path):
    sent = Sent(tmp_path)
    given = sent(0, 0)
    assert sent(1, 0) == given
    for scene in (1, 2):
        sent(0, scene)
    assert open_mapped(given) is not None, "rank 1 may not have opened it yet"
    for scene in (1, 2):
        assert isinstance(sent(1, scene), MappedFile)
    with pytest.raises(FileNotFoundError):
        open_mapped(given)
    assert sent.read == [0, 1, 2]
    assert isinstance(sent(0, 0), MappedFile)
    assert sent.read == [0, 1, 2, 0]
