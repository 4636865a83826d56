"""Studies with [scatter] from the file to the result."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from studyrunner.kinds.kind import build_tasks
from studyrunner.result.arrays import sample_coordinates
from studyrunner.scene.pairs import contact_changes
from studyrunner.scene.scene import build_study_scene, describe_scene
from studyrunner.scene.scene_set import find_scenes
from studyrunner.statistics.study_statistics import worn_volume_statistics
from studyrunner.study.realisation import draw_inputs, realise
from studyrunner.study.study_file import format_study, read_study
from tests.studyrunner.test_scene_axes import CHEAP, compute, same_values

pytestmark = pytest.mark.usefixtures("folder")
FRICTION = "scatter.friction_coefficient={normal={std=0.03}}"
WEAR = "scatter.wear_coefficient={lognormal={factor=1.5}}"


@pytest.mark.slow
@pytest.mark.parametrize(
    "widths",
    [
        ("friction_coefficient={normal={std=0}}", "frequency={uniform={half_width=0}}"),
        ("stiffness={lognormal={factor=1}}", "excitation_amplitude={normal={relative_std=0}}"),
        ("gap={normal={std=0}, of='each pair'}", "area={lognormal={factor=1}, of='each surface'}"),
        ("friction_coefficient={normal={std=0}, of='each pair'}", "wear_coefficient={lognormal={factor=1}}"),
    ],
)
def test_a_scatter_without_width_is_the_point(widths):
    asked = "outputs.variables=['default']"
    samples = compute("sdof_slider", "w.nc", *CHEAP, asked, "scatter.samples=2", *(f"scatter.{one}" for one in widths))
    names = ", ".join(f"'{name}'" for name in samples.drop_vars("stuck_frequency").data_vars)
    point = compute("sdof_slider", "p.nc", *CHEAP, f"outputs.variables=[{names}]")
    for sample in (0, 1):
        same_values(samples.isel(sample=sample), point)


@pytest.mark.slow
def test_more_samples_go_on_from_those_there_are(capsys):
    """Also where each sample has a scene of its own."""
    scatter = (FRICTION, "scatter.stiffness={normal={std=100}}")
    few = compute("sdof_slider", "o.nc", *CHEAP, "scatter.samples=2", *scatter)
    capsys.readouterr()
    many = compute("sdof_slider", "o.nc", *CHEAP, "scatter.samples=4", *scatter)
    assert "2 of 4 points are there from an earlier run" in capsys.readouterr().err
    same_values(many.isel(sample=slice(2)), few)
    xr.testing.assert_identical(compute("sdof_slider", "n.nc", *CHEAP, "scatter.samples=4", *scatter), many)
    assert len(np.unique(many.worn_volume[..., -1])) == 4


@pytest.mark.slow
def test_scatter_of_the_wear_coefficient_alone_is_one_history():
    given = (*CHEAP, "axes.scheme=adaptive", "scatter.samples=64", WEAR)
    study = read_study("sdof_slider", given)
    plan = build_tasks(study, 2)
    assert (len(plan.sweeps), len(plan.results)) == (1, 1)
    ((reason, n_points),) = plan.left_out.items()
    assert n_points == 63
    assert "adaptive" in reason
    samples = compute("sdof_slider", "w.nc", *given)
    assert samples.newton_iterations.min() == samples.newton_iterations.max()
    for sample in (3, 40):
        value = float(samples.sample_wear_coefficient[sample])
        alone = compute("sdof_slider", "a.nc", *CHEAP, "axes.scheme=adaptive", f"axes.wear_coefficient={value!r}")
        one, other = (each.worn_volume.values.squeeze() for each in (samples.isel(sample=sample), alone))
        # both within rtol of the true volume; the steps are those of the largest coefficient
        np.testing.assert_allclose(one, other, rtol=1e-2)


@pytest.mark.slow
def test_a_sample_is_the_study_of_its_drawn_values():
    scatter = ("scatter.frequency={normal={std=0.5}}", "scatter.mass={normal={std=1e-3}}")
    asked = "outputs.variables=['worn_volume', 'exact']"
    samples = compute("sdof_slider", "w.nc", *CHEAP, "scatter.samples=3", FRICTION, *scatter, asked)
    for number in range(3):
        sample = samples.isel(sample=number)
        own = [
            f"axes.frequency={float(sample.sample_frequency)!r}",
            f"scene.friction_coefficient={float(sample.sample_friction_coefficient)!r}",
            f"scene.mass={float(sample.sample_mass)!r}",
        ]
        same_values(sample, compute("sdof_slider", "a.nc", *CHEAP, *own, asked))
    assert samples.sample_mass.attrs["units"] == "kg"
    assert samples.sample_frequency.attrs["units"] == "Hz"


@pytest.mark.slow
def test_pairs_that_differ_between_samples_have_the_dimension():
    """A scattered radius moves the strips; gaps are drawn around those of the scene of each sample."""
    given = ("scene.strips=10", "slow_time.cycles=0", "slow_time.outputs=1", "solver.harmonics=1")
    gap = "scatter.gap={normal={std=0}, of='each pair'}"
    samples = compute("cylinder_on_flat", "w.nc", *given, "scatter.samples=2", "scatter.R={normal={std=1e-4}}", gap)
    assert samples.sample_gap.dims == ("sample", "contact")
    gaps = [build_study_scene(each.study).contact.gap for each in realise(read_study("w.nc"))]
    np.testing.assert_array_equal(samples.sample_gap, gaps)
    assert samples.contact_x.dims == ("sample", "contact")
    assert samples.contact_exists.all()
    assert (samples.contact_area[0] != samples.contact_area[1]).all()


@pytest.mark.slow
def test_axes_and_samples_stand_side_by_side_and_the_result_is_the_study_again():
    axes = ("axes.stiffness=[1.7e5, 1.6e5]", "axes.friction_coefficient=[0.4, 0.6]", "axes.threshold=[0, 5]")
    given = (*CHEAP, "scatter.samples=2", FRICTION, WEAR, "wear.law=threshold", *axes)
    study = read_study("sdof_slider", given)
    Path("again.toml").write_text(format_study(study), encoding="utf-8")
    again = read_study("again.toml")
    assert (again.scene_axes, format_study(again)) == (study.scene_axes, format_study(study))
    assert [variant.scene for variant in again.variants] == [variant.scene for variant in study.variants]
    first = compute("sdof_slider", "first.nc", *given)
    assert first.worn_volume.dims[-5:] == ("stiffness", "friction_coefficient", "threshold", "sample", "cycle")
    assert first.sample_friction_coefficient.dims == ("friction_coefficient", "sample")
    drawn = [draw_inputs(variant)["friction_coefficient"] for variant in study.variants[:4:2]]
    np.testing.assert_array_equal(first.sample_friction_coefficient, drawn)
    xr.testing.assert_identical(compute("first.nc", "second.nc").drop_attrs(), first.drop_attrs())


# --- numbers of [wear] ---


def test_factors_of_surfaces_scatter():
    factor = "scatter.surfaces.support={lognormal={factor=1.5}}"
    study = read_study("sdof_slider", [*CHEAP, "wear.surfaces={support=0.5}", "scatter.samples=8", factor])
    (drawn,) = draw_inputs(study).values()
    assert [dict(part.study.wear.surfaces or {})["support"] for part in realise(study)] == drawn.tolist()
    assert np.median(drawn) == pytest.approx(0.5, rel=0.15)
    assert len(build_tasks(study, 2).sweeps) == 1, "all samples start from one state"
    Path("again.toml").write_text(format_study(study), encoding="utf-8")
    assert format_study(read_study("again.toml")) == format_study(study)


# --- closed forms: volume k_w c N times a constant, where nothing depends on wear ---

SLIDING = (
    *("scene.normal_stiffness=0", "axes.frequency=160", "axes.wear_coefficient=1e-11", "solver.harmonics=3"),
    *("solver.samples=32", "slow_time.cycles=2000", "slow_time.outputs=2", "outputs.variables=['worn_volume']"),
)


@pytest.mark.slow
def test_indices_of_saltelli_are_those_of_a_product():
    """ln k_w and ln c normal: S_1 = (exp(s_1^2) - 1) / (exp(s_1^2 + s_2^2) - 1), S_T1 = S_1 exp(s_2^2)."""
    surface = "scatter.surfaces={support={lognormal={factor=1.3}}}"
    study = ("axes.scheme=implicit", "axes.step=2000", "scatter.method=saltelli", "scatter.samples=16", WEAR, surface)
    samples = compute("sdof_slider", "w.nc", *SLIDING, "wear.surfaces={support=0.5}", *study)
    assert samples.sizes["sample"] == 16 * 4
    # so that the indices are those of the product, of which 1024 base samples give the closed form to 0.03
    product = samples.sample_wear_coefficient * samples.sample_surfaces_support
    ratio = samples.worn_volume[..., -1] / product
    assert float(ratio.std() / ratio.mean()) < 1e-9
    found = worn_volume_statistics(samples).isel(cycle=-1).squeeze(drop=True)
    variances = {"wear_coefficient": np.log(1.5) ** 2, "surfaces_support": np.log(1.3) ** 2}
    whole = sum(variances.values())
    for name, variance in variances.items():
        first = np.expm1(variance) / np.expm1(whole)
        for index, exact in (("first_index", first), ("total_index", first * np.exp(whole - variance))):
            low, high = found[f"{index}_interval"].sel(input=name).values
            assert low < exact < high
        assert float(found.total_index.sel(input=name, bound="lowest")) == pytest.approx(exact, abs=0.1)


# --- the drawn values of pairs in the result file ---


def test_drawn_gaps_stand_along_the_axes_along_which_pairs_differ():
    gap = "scatter={samples = 2, gap = {normal = {std = 1e-9}, of = 'each pair'}}"
    axes = ("axes.strips=[20, 10]", "axes.E=[1e11, 2e11]", "scene.half_width=1e-3")
    study = read_study("cylinder_on_flat", [*axes, gap])
    scenes = find_scenes(study)
    facts = [describe_scene(build_study_scene(each)) for each in scenes.studies]
    (found,) = sample_coordinates(study, facts, scenes)
    assert found.entry.dimensions == ("strips", "sample", "contact")
    assert np.isfinite(found.values).sum(axis=-1).tolist() == [[10, 10], [5, 5]], "half of the strips, by symmetry"
    changes = contact_changes(study, scenes, facts)
    for place, part in enumerate(scenes.parts):
        ((_, gaps),) = changes[place]
        np.testing.assert_array_equal(found.values[part.place[0], part.place[-1]][: len(gaps)], gaps)
