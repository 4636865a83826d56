"""A scene file, and a result file, are each enough to have the same result again."""

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from studies.scene_file import read_mesh, read_scene
from studyrunner.cli import main
from studyrunner.result import provenance
from studyrunner.scene import scene as scene_room
from studyrunner.scene.scene import build_study_scene, describe_scene
from studyrunner.study.study_file import read_study
from tests.mpi.launching import options, results

pytestmark = [pytest.mark.usefixtures("folder"), pytest.mark.slow]

COARSE = ("scene.mesh=1", "axes.frequency=[211.5, 212.0]", "axes.scheme=implicit", "slow_time.cycles=500")
OUTPUTS = ("slow_time.outputs=2", 'outputs.variables=["default"]', "outputs.loops=[3]", "solver.rtol=0.1")
LEVELS = ("solver.harmonics=2", "solver.samples=64")
WAVE = ("scene.nodal_diameter=3", "scene.n_sectors=20")
STUDY = """
study = {name = "dovetail", title = "Fretting wear of a dovetail root around the first bending mode"}
scene = {model = "scene.h5", friction_coefficient = 0.5}
axes = {scheme = "implicit", frequency = [211.5, 212.0], excitation_amplitude = 0.5}
slow_time = {cycles = 500, outputs = 2}
solver = {rtol = 0.1}
outputs = {loops = [3]}
"""
SLIDER = ["sdof_slider", *options("axes.frequency=[150, 160]", "slow_time.cycles=2000", "slow_time.outputs=3")]
SLIDER += options("outputs.variables=['default', 'exact']")
KEEP = options("outputs.scene=true")


@pytest.fixture
def not_built(monkeypatch):
    """From when it is called on, bundled scenes cannot be built."""

    def refuse(*_):
        raise AssertionError("built again")

    return lambda: monkeypatch.setattr(scene_room, "build_scene", refuse)


def groups(path):
    """What the group of the scene holds."""
    found: dict[str, object] = {}

    def note(name, item):
        if isinstance(item, h5py.Dataset) and not item.is_scale:
            found[name] = repr(item[()].tolist())

    with h5py.File(path) as file:
        file["scene"].visititems(note)
        return found | {name: value for name, value in file["scene"].attrs.items() if name.startswith("n")}


# --- of a scene file ---


def test_a_written_scene_gives_the_same_result():
    assert main(["dovetail", "-o", "own.nc", *options(*COARSE, *OUTPUTS)]) == 0
    assert main(["dovetail", "--write-scene", "scene.h5", *options(*COARSE, *OUTPUTS)]) == 0
    Path("s.toml").write_text(STUDY, encoding="utf-8")
    assert main(["s.toml", "-o", "file.nc"]) == 0
    own, file = results("own.nc"), results("file.nc")
    assert "mesh_quad" in own
    assert list(own.variables) == list(file.variables)
    # a scene file does not say which mesh it is from
    assert {name for name in own.attrs if own.attrs[name] != file.attrs[name]} == {"study", "id", "summary"}
    own.attrs = file.attrs = {}
    xr.testing.assert_identical(own, file)
    # and the result alone is enough, wherever it is
    Path("elsewhere").mkdir()
    shutil.move("file.nc", "elsewhere/moved.nc")
    Path("scene.h5").unlink()
    assert main(["elsewhere/moved.nc", "-o", "again.nc"]) == 0
    xr.testing.assert_identical(results("again.nc"), results("elsewhere/moved.nc"))
    assert groups("again.nc") == groups("elsewhere/moved.nc")


# --- of a bundled scene that is kept in the result ---


def test_it_is_the_model_in_the_file_that_is_run_and_another_scene_or_solver_is_said(not_built, monkeypatch, capsys):
    """Twice all masses, stiffnesses and forces, and half the wear coefficient: the same motion and the same wear."""
    assert main([*SLIDER, *KEEP, "-o", "kept.nc"]) == 0
    with h5py.File("kept.nc", "r+") as file:
        for name in ("mass", "damping", "stiffness", "load/static", "load/harmonic", "contact/normal_load"):
            file[f"scene/{name}"][...] *= 2.0
    not_built()
    monkeypatch.setattr(provenance, "package_digest", lambda _: "another")
    capsys.readouterr()
    one = results("kept.nc")
    half = options(f"axes.wear_coefficient={0.5 * one.wear_coefficient.item()!r}")
    assert main(["kept.nc", *half, "-o", "twice.nc"]) == 0
    warned = [line for line in capsys.readouterr().err.splitlines() if "] kept.nc: " in line]
    assert ["another scene" in warned[0], "another solver" in warned[1], len(warned)] == [True, True, 2]
    twice = results("twice.nc")
    assert float(one.worn_volume.max()) > 0.0
    for name, factor in (("response_amplitude", 1.0), ("worn_volume", 1.0), ("mean_pressure", 2.0)):
        np.testing.assert_allclose(twice[name].values, factor * one[name].values, rtol=1e-6)


@pytest.mark.parametrize("wave", [(), WAVE], ids=["standing", "travelling"])
def test_a_sector_keeps_all_nodal_diameters_and_its_mesh(wave, not_built):
    given = ("scene.mesh=1", "scene.stuck_modes=5", "axes.frequency=211.5", "slow_time.cycles=0", "outputs.scene=true")
    given += ("axes.scheme=implicit", "outputs.loops=[]", "outputs.variables=['worn_volume', 'mesh']", *wave, *LEVELS)
    study = read_study("dovetail", given)
    model = build_study_scene(study)
    digest = describe_scene(model).digest
    assert main(["dovetail", *options(*given), "-o", "kept.nc"]) == 0
    not_built()
    kept = read_study("kept.nc")
    assert describe_scene(build_study_scene(kept)).digest == digest
    assert "mesh" in kept.scene.offers
    assert kept.scene.parameters == study.scene.parameters
    assert main(["kept.nc", "--write-scene", "root.h5"]) == 0
    assert describe_scene(read_scene("root.h5", 2)).digest == digest
    mesh, again = read_mesh("kept.nc", "scene"), read_mesh("root.h5")
    assert (mesh.nodes.tobytes(), mesh.quads.tobytes(), mesh.parts) == (
        again.nodes.tobytes(),
        again.quads.tobytes(),
        again.parts,
    )
    with h5py.File("root.h5") as file:
        assert "mesh/quad" in file
        assert set(file.get("nd", ())) == ({str(number) for number in model.linear} if wave else set())
        assert not wave or {0, 3, 6} <= set(model.linear)
