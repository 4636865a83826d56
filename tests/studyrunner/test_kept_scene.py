"""`outputs.scene`: the reduced model of a bundled scene stands in the result, which is then run with it."""

import h5py
import netCDF4
import numpy as np
import pytest
import xarray as xr

from studies.scene_file import read_scene
from studyrunner.cli import main
from studyrunner.scene import scene as scene_room
from studyrunner.scene.scene import build_study_scene, describe_scene
from studyrunner.study.study_file import read_study
from tests.mpi.launching import results

pytestmark = pytest.mark.usefixtures("folder")

SLIDER = ["sdof_slider", "--set", "axes.frequency=[150, 160]", "--set", "slow_time.cycles=2000"]
SLIDER += ["--set", "slow_time.outputs=3", "--set", "outputs.variables=['default', 'exact']"]
KEEP = ["--set", "outputs.scene=true"]


@pytest.fixture
def not_built(monkeypatch):
    """From when it is called on, bundled scenes cannot be built."""

    def refuse(*_):
        raise AssertionError("built again")

    return lambda: monkeypatch.setattr(scene_room, "build_scene", refuse)


@pytest.mark.slow
def test_the_result_is_enough(not_built):
    assert main([*SLIDER, "-o", "plain.nc"]) == 0
    assert main([*SLIDER, *KEEP, "-o", "kept.nc"]) == 0
    plain, kept = results("plain.nc"), results("kept.nc")
    assert {name for name in kept.attrs if kept.attrs[name] != plain.attrs[name]} == {"study", "id"}
    xr.testing.assert_identical(kept.drop_attrs(), plain.drop_attrs())
    with netCDF4.Dataset("plain.nc") as file:
        assert "scene" not in file.groups

    not_built()
    assert main(["kept.nc", "-o", "again.nc"]) == 0
    xr.testing.assert_identical(results("again.nc"), kept)
    with netCDF4.Dataset("kept.nc") as one, netCDF4.Dataset("again.nc") as other:
        assert one["scene/stiffness"][:].tolist() == other["scene/stiffness"][:].tolist()
        assert set(one["scene"].groups) == {"contact", "load", "response"}
    assert main(["again.nc", "--write-scene", "slider.h5"]) == 0
    assert describe_scene(read_scene("slider.h5")).digest == kept.attrs["scene_sha256"]


@pytest.mark.slow
def test_it_is_the_model_in_the_file_that_is_run(not_built, capsys):
    """Twice all masses, stiffnesses and forces, and half the wear coefficient: the same motion and the same wear."""
    assert main([*SLIDER, *KEEP, "-o", "kept.nc"]) == 0
    with h5py.File("kept.nc", "r+") as file:
        for name in ("mass", "damping", "stiffness", "load/static", "load/harmonic", "contact/normal_load"):
            values = file[f"scene/{name}"]
            values[...] = 2.0 * values[...]
    not_built()
    capsys.readouterr()
    one = results("kept.nc")
    half = ["--set", f"axes.wear_coefficient={0.5 * one.wear_coefficient.item()!r}"]
    assert main(["kept.nc", *half, "-o", "twice.nc"]) == 0
    assert "another scene" in capsys.readouterr().err
    twice = results("twice.nc")
    assert float(one.worn_volume.max()) > 0.0
    for name, factor in (("response_amplitude", 1.0), ("worn_volume", 1.0), ("mean_pressure", 2.0)):
        np.testing.assert_allclose(twice[name].values, factor * one[name].values, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("wave", [(), ("scene.nodal_diameter=3", "scene.n_sectors=20")], ids=["standing", "travelling"])
def test_a_sector_keeps_all_nodal_diameters_and_its_mesh(wave, not_built):
    coarse = ("scene.mesh=1", "scene.stuck_modes=5", "axes.frequency=211.5", "slow_time.cycles=0", "outputs.scene=true")
    overrides = ("axes.scheme=implicit", "outputs.loops=[]", "outputs.variables=['worn_volume', 'mesh']")
    study = read_study("dovetail", [*coarse, *overrides, *wave, "solver.harmonics=2", "solver.samples=32"])
    model = build_study_scene(study)
    digest = describe_scene(model).digest
    settings = [part for text in (*coarse, *overrides, *wave) for part in ("--set", text)]
    settings += ["--set", "solver.harmonics=2", "--set", "solver.samples=32"]
    assert main(["dovetail", *settings, "-o", "kept.nc"]) == 0
    not_built()
    kept = read_study("kept.nc")
    assert describe_scene(build_study_scene(kept)).digest == digest
    assert "mesh" in kept.scene.offers
    assert kept.scene.parameters == study.scene.parameters
    assert main(["kept.nc", "--write-scene", "root.h5"]) == 0
    with h5py.File("root.h5") as file:
        assert "mesh/quad" in file
        assert set(file.get("nd", ())) == ({str(number) for number in model.linear} if wave else set())
        assert not wave or {0, 3, 6} <= set(model.linear)
