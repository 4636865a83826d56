"""Axes that are keys of [scene] or [wear]: each point is the one of a study of its own, to the last bit."""

import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
import xarray as xr

from studyrunner.cli import main
from studyrunner.kinds.kind import build_tasks
from studyrunner.result.opening import open_known
from studyrunner.scene.scene_set import find_scenes
from studyrunner.study.study_file import format_study, read_study
from studyrunner.user_error import UserError
from tests.mpi.launching import results
from tests.studies.fe_models.decks import SECTOR
from tests.studyrunner.test_model_studies import STUDY as SECTOR_STUDY

pytestmark = pytest.mark.usefixtures("folder")
CHEAP = (
    *("axes.frequency=160", "axes.scheme=implicit", "axes.step=1000", "solver.harmonics=3", "solver.samples=32"),
    *("slow_time.cycles=2000", "slow_time.outputs=3"),
)
UNWORN = ("slow_time.cycles=0", "slow_time.outputs=1")


def arguments(study, output, *overrides):
    return [study, "-o", output, *(part for text in overrides for part in ("--set", text))]


def compute(study, output, *overrides):
    """A result without what depends on the machine."""
    assert main(arguments(study, output, *overrides)) == 0
    return results(output)


def same_values(one, other):
    """All variables, to the last bit."""
    assert set(one.data_vars) == set(other.data_vars)
    for name in one.data_vars:
        np.testing.assert_array_equal(one[name].values, other[name].values, err_msg=str(name), strict=True)


@pytest.mark.slow
def test_each_point_of_axes_of_the_scene_is_a_study_of_its_own():
    asked = "outputs.variables=['default', 'wear_depth', 'exact']"
    axes = ("axes.stiffness=[1.7e5, 1.6e5]", "axes.friction_coefficient=[0.3, 0.6]")
    # friction alone builds no scene
    assert find_scenes(read_study("sdof_slider", [*CHEAP, *axes])).numbers == (0, 0, 1, 1)
    whole = compute("sdof_slider", "whole.nc", *CHEAP, asked, *axes)
    assert whole.worn_volume.dims[5:] == ("sweep", "stiffness", "friction_coefficient", "cycle")
    assert whole.friction_coefficient.attrs["long_name"] == "Coulomb friction coefficient"
    assert (whole.friction_coefficient.attrs["units"], whole.stiffness.attrs["units"]) == ("1", "N/m")
    volumes = set()
    for stiffness, friction in ((1.6e5, 0.6), (1.7e5, 0.3), (1.7e5, 0.6)):
        own = (f"scene.stiffness={stiffness}", f"scene.friction_coefficient={friction}")
        alone = compute("sdof_slider", "own.nc", *CHEAP, asked, *own)
        same_values(whole.sel(stiffness=stiffness, friction_coefficient=friction), alone)
        volumes.add(float(alone.worn_volume[..., -1].sum()))
        assert alone.worn_volume.values == pytest.approx(alone.exact_worn_volume.values, rel=0.05, nan_ok=True)
    assert len(volumes) == 3


@pytest.mark.slow
def test_ratios_are_frequencies_of_each_scene():
    """Of two chains whose natural frequencies differ: to the last bit the points of studies in Hz."""
    given = (
        "axes.excitation_amplitude=20",
        "axes.mass_1=[1.0, 2.0]",
        "slow_time.cycles=0",
        "outputs.variables=['response_peak']",
    )
    Path("s.toml").write_text(
        '[study]\nname = "s"\n[scene]\nmodel = "two_masses"\n[axes]\nfrequency_ratio = [0.8, 1.1]\n', encoding="utf-8"
    )
    assert main(["s.toml", "--plan"]) == 0
    whole = compute("s.toml", "whole.nc", *given)
    assert whole.frequency.dims == ("frequency_ratio", "mass_1")
    np.testing.assert_array_equal(whole.frequency, whole.frequency_ratio * whole.stuck_frequency)
    assert open_known("whole.nc").frequency.equals(whole.frequency)
    assert np.ptp(whole.stuck_frequency.values) > 0.02
    xr.testing.assert_identical(compute("whole.nc", "again.nc").drop_attrs(), whole.drop_attrs())
    for mass in (1.0, 2.0):
        hertz = whole.frequency.sel(mass_1=mass).values.tolist()
        text = '[study]\nname = "h"\n[scene]\nmodel = "two_masses"\n[axes]\n'
        Path("h.toml").write_text(f"{text}frequency = {hertz}\n", encoding="utf-8")
        alone = compute("h.toml", f"{mass}.nc", *given[:1], f"axes.mass_1={mass}", *given[2:])
        for name in ("outcome", "response_peak", "newton_iterations"):
            np.testing.assert_array_equal(whole[name].sel(mass_1=mass), alone[name].squeeze("mass_1"))


@pytest.mark.slow
def test_thresholds_share_start_states():
    law = ("wear.law=threshold", "axes.threshold=[0, 5, 1e9]")
    plan = build_tasks(read_study("sdof_slider", [*CHEAP, *law]), 2)
    assert len(plan.sweeps) == 1
    assert len(plan.results) == 3
    whole = compute("sdof_slider", "whole.nc", *CHEAP, *law)
    assert whole.threshold.attrs["units"] == "J/m2"
    volume = whole.worn_volume.isel(cycle=-1).squeeze().values
    assert volume[0] > volume[1] > volume[2] == 0.0
    alone = compute("sdof_slider", "alone.nc", *CHEAP, "wear.law=threshold", "wear.threshold=5")
    same_values(whole.sel(threshold=5.0), alone)


@pytest.mark.slow
def test_pairs_of_scenes_of_different_size_are_padded():
    whole = compute("cylinder_on_flat", "whole.nc", *UNWORN, "axes.strips=[20, 10]", "scene.half_width=1e-3")
    counts = [int(number) for number in whole.contact_exists.sum("contact")]
    assert whole.contact_exists.dims == ("strips", "contact")
    assert counts[0] > counts[1]
    alone = compute("cylinder_on_flat", "alone.nc", *UNWORN, "scene.strips=10", "scene.half_width=1e-3")
    assert alone.sizes["contact"] == counts[1]
    own = whole.sel(strips=10).isel(contact=slice(counts[1]))
    same_values(own, alone)
    for name in ("contact_x", "contact_area", "contact_surface"):
        np.testing.assert_array_equal(own[name], alone[name])
    rest = whole.sel(strips=10).isel(contact=slice(counts[1], None))
    assert rest.mean_pressure.isnull().all()
    assert rest.contact_area.isnull().all()


def test_factors_of_a_surface_are_an_axis():
    factors = ("axes.surfaces={flat=[0.5, 1.0]}", "wear.surfaces={cylinder=0.5}")
    with pytest.raises(UserError, match=r"wear.surfaces.flat = 0.5: give it once, here or as axes.surfaces.flat"):
        read_study("cylinder_on_flat", ["axes.surfaces={flat=[0.5, 1.0]}"])
    varied = read_study("cylinder_on_flat", factors)
    assert [dict(variant.wear.surfaces or {}) for variant in varied.variants] == [
        {"cylinder": 0.5, "flat": 0.5},
        {"cylinder": 0.5, "flat": 1.0},
    ]
    assert varied.variants[0].wear == read_study("cylinder_on_flat").wear
    assert dict(varied.dimensions)["surfaces_flat"] == (0.5, 1.0)


@pytest.mark.slow
def test_natural_frequencies_stand_along_the_axes_of_their_scenes():
    asked = ("outputs.variables=['natural_frequency']", "axes.frequency=0.05", "solver.harmonics=1")
    axes = ("axes.friction_coefficient=[0.1, 0.2]", "axes.stiffness_2=[0.5, 1.0]")
    whole = compute("two_masses", "whole.nc", *asked, *axes)
    assert whole.natural_frequency.dims == ("stiffness_2", "nodal_diameter", "mode")
    for stiffness in (0.5, 1.0):
        alone = compute("two_masses", "alone.nc", *asked, f"scene.stiffness_2={stiffness}")
        np.testing.assert_array_equal(whole.natural_frequency.sel(stiffness_2=stiffness), alone.natural_frequency)


@pytest.mark.slow
def test_friction_of_a_surface_of_a_deck_is_an_axis(capsys):
    shutil.copy(SECTOR, "sector.inp")
    Path("wear.toml").write_text(SECTOR_STUDY.replace("friction_coefficient = 0.1\n", ""), encoding="utf-8")
    said = refused("wear.toml", ["axes.friction_coefficient={A=[0.1, 0.2]}"], capsys)
    assert "friction_coefficient.A: no contact has this name" in said
    own = compute("wear.toml", "own.nc", "scene.friction_coefficient={BLADES=0.2}", "slow_time.cycles=0")
    both = compute("wear.toml", "both.nc", "axes.friction_coefficient={BLADES=[0.1, 0.2]}", "slow_time.cycles=0")
    same_values(both.sel(friction_coefficient_BLADES=0.2), own)


# --- files ---


def test_width_that_each_scene_chooses_is_chosen_again():
    text = '[study]\nname = "s"\n[scene]\nmodel = "cylinder_on_flat"\nstroke = 1e-5\n[axes]\nfrequency = 20.0\n'
    Path("s.toml").write_text(f"{text}wear_coefficient = 1e-12\nP = [1e5, 2e5]\n", encoding="utf-8")
    study = read_study("s.toml")
    Path("again.toml").write_text(format_study(study), encoding="utf-8")
    widths = [
        [dict(variant.scene.parameters)["half_width"] for variant in each.variants]
        for each in (study, read_study("again.toml"))
    ]
    assert widths[0] == widths[1]
    assert widths[0][0] < widths[0][1]


def test_one_scene_of_several_is_neither_written_nor_kept(capsys):
    axis = ("--set", "axes.stiffness=[1.6e5, 1.7e5]")
    assert main(["sdof_slider", *axis, "--write-scene", "s.h5"]) == 2
    assert "axes.stiffness: give one value: a scene file holds one scene" in capsys.readouterr().err
    for command in (["--plan"], ["-o", "o.nc"]):
        assert main(["sdof_slider", *axis, "--set", "outputs.scene=true", *command]) == 2
        assert "the study has 2 scenes, and a result keeps one" in capsys.readouterr().err
    assert not Path("o.nc").exists()


# --- what is wrong ---


def refused(study, overrides, capsys):
    command = [study, "--plan", *(part for text in overrides for part in ("--set", text))]
    assert main(command) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    return said[0].removeprefix(f"run-study: {study}: ")


def test_friction_of_a_scene_file_with_its_own_is_refused_by_its_key(capsys):
    assert main(["sdof_slider", "--write-scene", "s.h5"]) == 0
    capsys.readouterr()
    with h5py.File("s.h5", "r+") as file:
        file["contact/friction_coefficient"] = np.array([0.3])
    text = (
        '[study]\nname = "s"\n[scene]\nmodel = "s.h5"\n[axes]\nfrequency = 160.0\nfriction_coefficient = [0.3, 0.4]\n'
    )
    Path("s.toml").write_text(text, encoding="utf-8")
    assert refused("s.toml", [], capsys).startswith("axes.friction_coefficient = 0.3: remove it")
