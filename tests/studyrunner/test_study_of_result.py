"""A scene file and a result file are each enough to have the same result again."""

import shutil
from pathlib import Path

import h5py
import netCDF4
import numpy as np
import pytest
import xarray as xr

from studies.scene_file import read_mesh, read_scene
from studyrunner.cli import main
from studyrunner.result import provenance
from studyrunner.scene.scene import build_study_scene, describe_scene
from studyrunner.study.study_file import read_study
from tests.mpi.launching import results

COARSE = ("scene.mesh=1", "axes.frequency=[211.5, 212.0]", "axes.scheme=implicit", "slow_time.cycles=500")
OUTPUTS = ("slow_time.outputs=2", 'outputs.variables=["default"]', "outputs.loops=[3]", "solver.rtol=0.1")
WAVE = ("scene.nodal_diameter=3", "scene.n_sectors=20", "solver.harmonics=2", "solver.samples=64")

STUDY = """
[study]
name = "dovetail"
title = "Fretting wear of a dovetail root around the first bending mode"
[scene]
model = "files/scene.h5"
friction_coefficient = 0.5
[axes]
scheme = "implicit"
frequency = [211.5, 212.0]
excitation_amplitude = 0.5
[slow_time]
cycles = 500
outputs = 2
[solver]
rtol = 0.1
[outputs]
loops = [3]
"""
SLIDER = """
[study]
name = "slider"
[scene]
model = "slider.h5"
friction_coefficient = 0.5
[axes]
frequency = [150, 160]
excitation_amplitude = 10
[slow_time]
cycles = 2000
outputs = 3
[outputs]
variables = ["default", "outcome"]
"""


def options(*overrides):
    return [part for text in overrides for part in ("--set", text)]


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder with a scene file and its result."""
    path = tmp_path_factory.mktemp("made")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(path)
        assert main(["sdof_slider", "--write-scene", "slider.h5"]) == 0
        Path("slider.toml").write_text(SLIDER, encoding="utf-8")
        assert main(["slider.toml"]) == 0
    return path


@pytest.fixture
def slider(made, folder):
    """A result of a scene file, which is not here."""
    return Path(shutil.copy(made / "slider.nc", folder))


def groups(path):
    """What the group of the scene holds."""
    found: dict[str, object] = {}
    with h5py.File(path) as file:

        def note(name, item):
            if isinstance(item, h5py.Dataset) and not item.is_scale:
                found[name] = item[()].tolist()

        file["scene"].visititems(note)
        found |= {
            name: file["scene"].attrs[name] for name in ("n_sectors", "nodal_diameter") if name in file["scene"].attrs
        }
    return found


@pytest.mark.slow
def test_a_written_scene_gives_the_same_result(folder):
    assert main(["dovetail", "-o", "own.nc", *options(*COARSE, *OUTPUTS)]) == 0
    Path("files").mkdir()
    assert main(["dovetail", "--write-scene", "files/scene.h5", *options(*COARSE, *OUTPUTS)]) == 0
    Path("s.toml").write_text(STUDY, encoding="utf-8")
    assert main(["s.toml", "-o", "file.nc"]) == 0
    own, file = results("own.nc"), results("file.nc")
    assert "mesh_quad" in own
    assert list(own.variables) == list(file.variables)
    differing = {name for name in own.attrs if own.attrs[name] != file.attrs[name]}
    # a scene file does not say which mesh it is from
    assert differing == {"study", "id", "summary"}
    own.attrs = file.attrs = {}
    xr.testing.assert_identical(own, file)

    # and the result alone is enough, wherever it is
    Path("elsewhere").mkdir()
    shutil.move("file.nc", "elsewhere/moved.nc")
    shutil.rmtree("files")
    assert main(["elsewhere/moved.nc", "-o", "again.nc"]) == 0
    xr.testing.assert_identical(results("again.nc"), results("elsewhere/moved.nc"))
    assert groups("again.nc") == groups("elsewhere/moved.nc")


@pytest.mark.slow
def test_mesh_and_model_come_back_bit_by_bit(folder):
    study = read_study("dovetail", (*COARSE, *WAVE))
    assert main(["dovetail", "--write-scene", "wave.h5", *options(*COARSE, *WAVE)]) == 0
    mesh = read_mesh("wave.h5")
    Path("wave.toml").write_text(STUDY.replace("files/scene.h5", "wave.h5"), encoding="utf-8")
    assert main(["wave.toml", "-o", "out.nc", *options("slow_time.cycles=0", "slow_time.outputs=1", *WAVE[2:])]) == 0
    kept = read_mesh("out.nc", "scene")
    assert np.array_equal(kept.nodes, mesh.nodes)
    assert np.array_equal(kept.quads, mesh.quads)
    assert kept.parts == mesh.parts
    digest = describe_scene(build_study_scene(study)).digest
    assert describe_scene(read_scene("wave.h5", 2)).digest == digest
    assert describe_scene(read_scene("out.nc", 2, "scene")).digest == digest
    with netCDF4.Dataset("out.nc") as file:
        assert file["scene/nd/3/stiffness"].datatype.name == "complex"
    assert main(["out.nc", "--write-scene", "again.h5"]) == 0
    assert describe_scene(read_scene("again.h5", 2)).digest == digest
    assert main(["out.nc", "--plan"]) == 0


def change(path, work):
    with h5py.File(path, "r+") as file:
        work(file)


@pytest.mark.slow
def test_another_scene_or_solver_is_said_and_computed_all_the_same(slider, capsys, monkeypatch):
    capsys.readouterr()
    monkeypatch.setattr(provenance, "solver_digest", lambda: "another")
    change(slider, lambda file: file["scene/contact/area"].write_direct(np.array([1.1e-4])))
    assert main(["slider.nc", "-o", "again.nc"]) == 0
    warned = [line for line in capsys.readouterr().err.splitlines() if "] slider.nc: " in line]
    assert len(warned) == 2
    assert "another scene" in warned[0]
    assert "computed by another solver" in warned[1]
    assert "fretwear" in warned[1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("work", "words"),
    [
        (lambda file: file.attrs.__delitem__("study"), ("the attribute study", "missing")),
        (lambda file: file.attrs.__setitem__("study", "[study"), ("slider.nc", "valid TOML")),
        (lambda file: file.__delitem__("scene"), ("scene.model", "no such file")),
        (lambda file: file["scene"].__setitem__("mass2", h5py.ExternalLink("o.h5", "/")), ("mass2", "a link")),
    ],
)
def test_a_result_file_that_was_tampered_with(work, words, slider, capsys):
    change(slider, work)
    capsys.readouterr()
    assert main(["slider.nc", "-o", "x.nc"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    for word in words:
        assert word in said[0]
