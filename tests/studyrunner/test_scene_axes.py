"""Axes that are keys of [scene] or [wear], worn joints, exact answers: each point is one of a study of its own."""

import math
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from studies.fe_models.from_files.parameters import Parameters
from studies.finite_element import reduction
from studies.finite_element.elimination import NotPositiveDefiniteError, factorise
from studies.scenes import scene_parameters
from studyrunner import compute_worn_joint
from studyrunner.cli import main
from studyrunner.kinds.table import KINDS
from studyrunner.result.opening import open_known
from studyrunner.scene.answers import exact_answers
from studyrunner.scene.scene_set import find_scenes
from studyrunner.study.scene_axes import describe_key
from studyrunner.study.study_file import read_study
from tests.mpi.launching import options, results
from tests.studyrunner.fakes import plan_of
from tests.studyrunner.small_studies import CHEAP, UNWORN, compute, same_values, write_depths

pytestmark = pytest.mark.usefixtures("folder")
THREE = ("slow_time.outputs=3", "axes.scheme=adaptive")
EXACT = "outputs.variables=['default', 'exact']"


def test_the_unit_of_an_axis_is_metadata_of_its_key():
    shown = {"stroke": "m", "E": "Pa", "nu": "1"}
    assert {name: describe_key(scene_parameters("sphere_on_flat"), name)[0] for name in shown} == shown
    assert describe_key(Parameters, "rotation_speed") == ("rpm", "rotation speed")
    assert describe_key(Parameters, "preload", "force") == ("N", "force of preload")


@pytest.mark.slow
def test_each_point_of_axes_of_the_scene_is_a_study_of_its_own():
    axes = ("axes.stiffness=[1.7e5, 1.6e5]", "axes.friction_coefficient=[0.3, 0.6]")
    # friction alone builds no scene
    assert find_scenes(read_study("sdof_slider", [*CHEAP, *axes])).of_blocks == ((0,), (0,), (1,), (1,))
    whole = compute("sdof_slider", "whole.nc", *CHEAP, EXACT, *axes)
    assert whole.worn_volume.dims[5:] == ("sweep", "stiffness", "friction_coefficient", "cycle")
    assert whole.friction_coefficient.attrs["long_name"] == "Coulomb friction coefficient"
    assert (whole.friction_coefficient.attrs["units"], whole.stiffness.attrs["units"]) == ("1", "N/m")
    volumes = set()
    for stiffness, friction in ((1.6e5, 0.6), (1.7e5, 0.3), (1.7e5, 0.6)):
        own = (f"scene.stiffness={stiffness}", f"scene.friction_coefficient={friction}")
        alone = compute("sdof_slider", "own.nc", *CHEAP, EXACT, *own)
        same_values(whole.sel(stiffness=stiffness, friction_coefficient=friction), alone)
        volumes.add(float(alone.worn_volume[..., -1].sum()))
        assert alone.worn_volume.values == pytest.approx(alone.exact_worn_volume.values, rel=0.05, nan_ok=True)
    assert len(volumes) == 3


@pytest.mark.slow
def test_ratios_are_frequencies_of_each_scene():
    """Of two chains whose natural frequencies differ: to the last bit the points of studies in Hz."""
    given = ("axes.excitation_amplitude=20", "slow_time.cycles=0", "outputs.variables=['response_peak']")
    text = '[study]\nname = "s"\n[scene]\nmodel = "two_masses"\n[axes]\n'
    Path("s.toml").write_text(f"{text}frequency_ratio = [0.8, 1.1]\n", encoding="utf-8")
    assert main(["s.toml", "--plan"]) == 0
    whole = compute("s.toml", "whole.nc", *given, "axes.mass_1=[1.0, 2.0]")
    assert whole.frequency.dims == ("frequency_ratio", "mass_1")
    np.testing.assert_array_equal(whole.frequency, whole.frequency_ratio * whole.stuck_frequency)
    assert open_known("whole.nc").frequency.equals(whole.frequency)
    assert np.ptp(whole.stuck_frequency.values) > 0.02
    xr.testing.assert_identical(compute("whole.nc", "again.nc").drop_attrs(), whole.drop_attrs())
    for mass in (1.0, 2.0):
        hertz = whole.frequency.sel(mass_1=mass).values.tolist()
        Path("h.toml").write_text(f"{text}frequency = {hertz}\n", encoding="utf-8")
        alone = compute("h.toml", f"{mass}.nc", *given, f"axes.mass_1={mass}")
        for name in ("outcome", "response_peak", "newton_iterations"):
            np.testing.assert_array_equal(whole[name].sel(mass_1=mass), alone[name].squeeze("mass_1"))


@pytest.mark.slow
def test_thresholds_share_start_states():
    law = ("wear.law=threshold", "axes.threshold=[0, 5, 1e9]")
    plan = plan_of(read_study("sdof_slider", [*CHEAP, *law]), 2)
    assert (len(plan.sweeps), len(plan.results)) == (1, 3)
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


@pytest.mark.slow
def test_a_history_that_begins_with_a_worn_joint_goes_on_where_the_other_ended():
    slider = ("axes.frequency=150", "axes.wear_coefficient=1e-10", "axes.excitation_amplitude=20", *THREE)
    before = compute("sdof_slider", "whole.nc", *slider, "slow_time.cycles=2000").squeeze()
    worn = f"scene.worn={{result='{Path('whole.nc').absolute()}', cycle=[0, 1000]}}"
    states = compute("sdof_slider", "worn.nc", *slider, "slow_time.cycles=1000", worn).squeeze()
    np.testing.assert_array_equal(states.worn_cycle, [0.0, 1000.0])
    np.testing.assert_array_equal(states.worn_depth, before.wear_depth.sel(cycle=[0.0, 1000.0]))
    # the unworn state is the same study
    volume, response = before.worn_volume, states.response_amplitude.isel(cycle=0)
    wears = [volume.sel(cycle=1000.0), volume.sel(cycle=2000.0) - volume.sel(cycle=1000.0)]
    np.testing.assert_allclose(states.worn_volume.isel(cycle=-1), wears, rtol=1e-2)
    np.testing.assert_allclose(response[1], before.response_amplitude.sel(cycle=1000.0), rtol=1e-3)
    assert response[1] > 1.002 * response[0]
    # what is computed again of the worn joint adds the depth at the start
    compute_worn_joint("worn.nc", ".", loops=[0], point={"worn_cycle": "1000"}, progress=False)
    depth = float(states.worn_depth[1] + states.wear_depth[1, -1])
    assert results("worn_joint_loops.nc").worn_depth.values.ravel()[-1] == pytest.approx(depth, rel=1e-12)


def test_a_result_to_the_end_gives_its_depths_by_cycle_count(folder):
    write_depths("ended.nc", 150.0, [0.0, 5.0, 7.0], 1, counts=[0.0, 1234.5, math.inf])
    worn = f"scene.worn={{result='{folder / 'ended.nc'}', cycle=[1234.5]}}"
    study = read_study("sdof_slider", (*CHEAP, worn))
    assert study.dimensions["worn_cycle"] == (1234.5,)
    assert study.variants[0].scene.worn.depths(1) == (5e-9,)


def test_depths_are_those_of_the_pairs_of_the_chosen_scene(folder):
    write_depths("both.nc", 150.0, [0.0, 1.0], 2)
    with xr.open_dataset("both.nc") as both:
        depth = both.wear_depth.copy()
        depth[..., 1] = np.nan
        both.assign(wear_depth=depth, contact_exists=("contact", [1, 0])).to_netcdf("one.nc")
    study = read_study("sdof_slider", (*CHEAP, f"scene.worn={{result='{folder / 'one.nc'}', cycle=[1]}}"))
    assert study.variants[0].scene.worn.depths(1) == (1e-9,)


# --- variables of the scene itself ---


@pytest.mark.slow
def test_natural_frequencies_stand_along_the_axes_of_their_scenes():
    asked = ("outputs.variables=['natural_frequency']", "axes.frequency=0.05", "solver.harmonics=1")
    axes = ("axes.friction_coefficient=[0.1, 0.2]", "axes.stiffness_2=[0.5, 1.0]")
    whole = compute("two_masses", "whole.nc", *asked, *axes)
    assert whole.natural_frequency.dims == ("stiffness_2", "nodal_diameter", "mode")
    for stiffness in (0.5, 1.0):
        alone = compute("two_masses", "alone.nc", *asked, f"scene.stiffness_2={stiffness}")
        np.testing.assert_array_equal(whole.natural_frequency.sel(stiffness_2=stiffness), alone.natural_frequency)


def test_exact_answers_stand_at_their_points():
    axes = ("axes.frequency=[160, 60, 150]", "axes.excitation_amplitude=[10, 11]", "axes.wear_coefficient=[1e-11, 0]")
    others = ("slow_time.outputs=3", "axes.step=[10, 100]", "axes.harmonics=[1, 3]")
    found = {scene.name: scene.values for scene in exact_answers(read_study("sdof_slider", (*axes, *others, EXACT)))}
    volume, response = found["exact_worn_volume"], found["exact_response_amplitude"]
    # frequency, wear coefficient, excitation amplitude; nothing depends on the other axes and harmonics
    shape = (3, 2, 2, *[1] * (len(KINDS["wear"].axes) - 3), 1)
    assert volume.shape == (*shape, 3)
    assert response.shape == (*shape, 3, 1)
    assert np.isnan(volume[1]).all()
    assert not volume[[0, 2], 1].any()
    assert (np.diff(volume[[0, 2], 0], axis=-1) > 0.0).all()
    for frequency, at in ((0, 160), (2, 150)):
        for amplitude, force in ((0, 10), (1, 11)):
            own = (f"axes.frequency={at}", f"axes.excitation_amplitude={force}", "axes.wear_coefficient=1e-11")
            one, other = exact_answers(read_study("sdof_slider", (*own, "slow_time.outputs=3", EXACT)))
            assert np.array_equal(one.values.ravel(), volume[frequency, 0, amplitude].ravel())
            assert np.array_equal(other.values.ravel(), response[frequency, 0, amplitude].ravel())


@pytest.mark.parametrize(
    ("changes", "computed_volume"),
    # m3, with 35 harmonics, 1024 samples, rtol 1e-4
    [
        (("wear.law=energy",), 6.16499e-10),
        (("wear.law=threshold", "wear.threshold=50"), 1.51371e-10),
        (("wear.law=table", "wear.pressure=[0.0]", "wear.depth=[0.0]", "wear.factor=[[0.5]]"), 6.16499e-10),
        (("wear.surfaces={support=0.5}",), 6.16499e-10),
        (("scene.worn={depth=2e-5}",), 1.021383e-9),
        # not known in closed form
        (("scene.damping=0.1",), math.nan),
    ],
)
def test_the_exact_answer_is_that_of_the_wear_law_and_of_the_worn_start(changes, computed_volume):
    study = read_study("sdof_slider", ("axes.frequency=160", "slow_time.outputs=2", EXACT, *changes))
    volume, response = exact_answers(study)
    assert volume.values.ravel()[-1] == pytest.approx(computed_volume, rel=5e-5, nan_ok=True)
    expected = math.nan if math.isnan(computed_volume) else 1.535e-4 if "worn" in changes[0] else 1.438e-4
    assert response.values.ravel()[0] == pytest.approx(expected, rel=1e-3, nan_ok=True)


@pytest.mark.parametrize("key", ["young_modulus=110", "blade_length=160.0"])
def test_of_a_sector_that_cannot_be_built_the_key_in_another_unit_is_named(key, folder, capsys):
    assert main(["dovetail", "--plan", *options("scene.mesh=1", f"scene.{key}")]) == 2
    assert capsys.readouterr().err.startswith(f"run-study: dovetail: scene.{key.split('=')[0]} = 1")


def test_a_sector_that_spins_too_fast_is_bad_input(folder, monkeypatch, capsys):
    """The nodal diameters of the study are fine, another one is not: known before anything is computed."""

    factorised = []

    def unstable(*given):
        factorised.append(given)
        # the scene: under its own load, and at the excited nodal diameter
        if len(factorised) > 2:
            raise NotPositiveDefiniteError(unstable=True)
        return factorise(*given)

    monkeypatch.setattr(reduction, "factorise", unstable)
    coarse = ("scene.mesh=1", "axes.frequency=212", "slow_time.cycles=0", "axes.scheme=implicit")
    assert main(["dovetail", "-o", "out.nc", *options(*coarse, "outputs.variables=['natural_frequency']")]) == 2
    assert "scene.rotation_speed = 3000: reduce it" in capsys.readouterr().err.splitlines()[-1]
    assert list(folder.iterdir()) == []
