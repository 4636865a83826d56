"""[scatter]: the designs, the values that samples draw, and studies of samples from the file to the result."""

from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from scipy.stats import kstest

from studyrunner.points.draw import draw_inputs
from studyrunner.points.table import points_of
from studyrunner.result.arrays import sample_coordinates
from studyrunner.scatter import ScatterSection, draw, flat_table, unit_design
from studyrunner.scene.scene import build_study_scene, describe_scene
from studyrunner.scene.scene_set import find_scenes
from studyrunner.study.study_file import read_study
from studyrunner.values import Wrong
from tests.studyrunner.fakes import plan_of
from tests.studyrunner.small_studies import CHEAP, UNWORN, compute, same_values

pytestmark = pytest.mark.usefixtures("folder")
NORMAL = {"normal": {"mean": 0.5, "std": 0.03}}
PAIRS = SimpleNamespace(surface=("left",) * 3 + ("right",) * 2, position=np.linspace(0.0, 1.0, 15).reshape(5, 3))
OWN = {"friction_coefficient": 0.3, "gap": np.linspace(0.0, 4e-6, 5), "wear_coefficient": 1.1e-11, "area": 0.1 + 0.2}
FRICTION = "scatter.friction_coefficient={normal={std=0.03}}"
WEAR = "scatter.wear_coefficient={lognormal={factor=1.5}}"


def read(**table):
    return ScatterSection.model_validate(flat_table({"samples": 64, **table}))


def drawn(own=OWN, pairs=PAIRS, **table):
    """Values of all inputs."""
    return draw(read(**table), own) | draw(read(**table), own, pairs)


# --- the designs ---


@pytest.mark.parametrize("method", ["sobol", "latin_hypercube", "random", "saltelli"])
def test_designs_fill_the_cube_and_further_columns_change_none(method):
    design = unit_design(method, 3, 256, 4)
    assert ((design > 0.0) & (design < 1.0)).all()
    assert [kstest(column, "uniform").pvalue > 1e-3 for column in design.T] == [True] * 4
    assert np.abs(np.corrcoef(design.T) - np.eye(4)).max() < (0.2 if method == "random" else 0.1)
    if method != "saltelli":
        np.testing.assert_array_equal(unit_design(method, 3, 256, 9)[:, :4], design)
        assert not np.array_equal(unit_design(method, 4, 256, 4), design)


# --- the drawn values ---


def test_each_distribution_has_its_quantiles():
    section = {
        "absolute": {"lognormal": {"median": 2.0, "factor": 1.5}},
        "area": {"normal": {"relative_std": 0.1}},
        "gap": {"uniform": {"half_width": 1e-6}},
        "range": {"uniform": {"low": 3.0, "high": 5.0}},
        "wear_coefficient": {"lognormal": {"factor": 1.5}},
    }
    found = drawn({"gap": np.ones(5), "area": np.ones(5), "wear_coefficient": 1.0}, samples=4096, **section)
    share = 0.8413447460685429  # one standard deviation above the median
    expected = {"absolute": 3.0, "area": 1.1, "gap": 1.0 + 1e-6 * (2 * share - 1), "range": 3 + 2 * share}
    for name, value in {**expected, "wear_coefficient": 1.5}.items():
        assert np.quantile(found[name], share) == pytest.approx(value, rel=2e-3)


def test_each_input_and_each_surface_has_a_draw():
    gap = {"normal": {"std": 1e-6}, "of": "each pair"}
    alone = drawn(friction_coefficient=NORMAL)["friction_coefficient"]
    beside = drawn(friction_coefficient=NORMAL, gap=gap)
    np.testing.assert_array_equal(beside["friction_coefficient"], alone)
    assert beside["gap"].shape == (64, 5)
    values = drawn(friction_coefficient={**NORMAL, "of": "each surface"})["friction_coefficient"]
    assert [len(np.unique(row)) for row in values] == [2] * 64
    assert (values[:, 0] == values[:, 2]).all()


def test_neighbouring_pairs_are_correlated_over_the_length():
    along = np.outer(np.repeat([0.0, 1.0, 3.0], 2), [1.0, 0.0, 0.0])
    pairs = SimpleNamespace(surface=("left", "right") * 3, position=along)
    gap = {"normal": {"std": 2.0}, "of": "each pair", "correlation_length": 1.0}
    values = drawn({"gap": np.zeros(6)}, pairs, gap=gap, samples=4096)["gap"]
    expected = np.where(
        np.arange(6)[:, None] % 2 == np.arange(6) % 2, np.exp(-0.5 * (along[:, :1] - along[:, 0]) ** 2), 0
    )
    np.testing.assert_allclose(np.corrcoef(values.T), expected, atol=0.03)
    np.testing.assert_allclose(values.std(axis=0), 2.0, rtol=0.02)


@pytest.mark.parametrize(
    ("own", "name", "given"),
    [
        # what physics forbids, of each value of an axis
        ({}, "friction_coefficient", {"normal": {"std": 0.3}}),
        ({}, "wear_coefficient", {"normal": {"relative_std": 1.0}}),
        ({}, "area", {"uniform": {"low": -1e-3, "high": 1.0}}),
        ({}, "frequency", {"uniform": {"low": -1.0, "high": 1.0}}),
        ({}, "excitation_amplitude", {"normal": {"mean": 1.0, "std": 1.0}}),
        ({"friction_coefficient": [[0.3], [0.1]]}, "friction_coefficient", {"uniform": {"half_width": 0.2}}),
        # a share of nothing, a length without positions
        ({"gap": np.zeros(5)}, "gap", {"normal": {"relative_std": 0.1}}),
        ({}, "gap", {"normal": {"std": 1e-6}, "of": "each pair", "correlation_length": 1e-3}),
    ],
)
def test_draws_that_cannot_be_are_refused(own, name, given):
    nowhere = SimpleNamespace(surface=PAIRS.surface, position=np.full((5, 3), np.nan))
    with pytest.raises(Wrong) as caught:
        drawn(OWN | own, nowhere, **{name: given}, samples=8192)
    assert caught.value.key.startswith(f"scatter.{name}")


# --- from the file to the result ---


@pytest.mark.slow
def test_a_scatter_without_width_is_the_point():
    of_pairs = ("gap={normal={std=0}, of='each pair'}", "area={lognormal={factor=1}, of='each surface'}")
    widths = (*of_pairs, "friction_coefficient={normal={std=0}, of='each pair'}", "mass={uniform={half_width=0}}")
    drawn = ("outputs.variables=['default']", "scatter.samples=2", *(f"scatter.{one}" for one in widths))
    samples = compute("sdof_slider", "w.nc", *CHEAP, *drawn)
    names = [str(name) for name in samples.drop_vars("stuck_frequency").data_vars]
    point = compute("sdof_slider", "p.nc", *CHEAP, f"outputs.variables={names}")
    for sample in (0, 1):
        same_values(samples.isel(sample=sample), point)


@pytest.mark.slow
def test_more_samples_go_on_from_those_there_are(capsys):
    """Also where each sample has a scene of its own."""
    scatter = (FRICTION, "scatter.stiffness={normal={std=100}}")
    few = compute("sdof_slider", "o.nc", *CHEAP, "scatter.samples=2", *scatter)
    capsys.readouterr()
    many = compute("sdof_slider", "o.nc", *CHEAP, "scatter.samples=4", *scatter)
    assert "from an earlier run: 2 of 4 points" in capsys.readouterr().err
    same_values(many.isel(sample=slice(2)), few)
    xr.testing.assert_identical(compute("sdof_slider", "n.nc", *CHEAP, "scatter.samples=4", *scatter), many)
    assert len(np.unique(many.worn_volume[..., -1])) == 4


@pytest.mark.slow
def test_scatter_of_the_wear_coefficient_alone_is_one_history():
    given = (*CHEAP, "axes.scheme=adaptive", "scatter.samples=64", WEAR)
    study = read_study("sdof_slider", given)
    plan = plan_of(study, 2)
    assert (len(plan.sweeps), len(plan.results), *plan.left_out.values()) == (1, 1, 63)
    samples = compute("sdof_slider", "w.nc", *given)
    assert samples.newton_iterations.min() == samples.newton_iterations.max()
    value = float(samples.sample_wear_coefficient[40])
    alone = compute("sdof_slider", "a.nc", *CHEAP, "axes.scheme=adaptive", f"axes.wear_coefficient={value!r}")
    one, other = (each.worn_volume.values.squeeze() for each in (samples.isel(sample=40), alone))
    # both within rtol of the true volume; the steps are those of the largest coefficient
    np.testing.assert_allclose(one, other, rtol=1e-2)


@pytest.mark.slow
def test_a_sample_is_the_study_of_its_drawn_values():
    scatter = ("scatter.frequency={normal={std=0.5}}", "scatter.mass={normal={std=1e-3}}")
    asked = "outputs.variables=['worn_volume', 'exact']"
    samples = compute("sdof_slider", "w.nc", *CHEAP, "scatter.samples=2", FRICTION, *scatter, asked)
    for number in range(2):
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
    given = ("scene.strips=10", *UNWORN, "solver.harmonics=1")
    gap = "scatter.gap={normal={std=0}, of='each pair'}"
    samples = compute("cylinder_on_flat", "w.nc", *given, "scatter.samples=2", "scatter.R={normal={std=1e-4}}", gap)
    assert samples.sample_gap.dims == ("sample", "contact")
    gaps = [build_study_scene(each).contact.gap for each in points_of(read_study("w.nc")).studies]
    np.testing.assert_array_equal(samples.sample_gap, gaps)
    assert samples.contact_x.dims == ("sample", "contact")
    assert samples.contact_exists.all()
    assert (samples.contact_area[0] != samples.contact_area[1]).all()


@pytest.mark.slow
def test_a_run_ends_with_the_probability_of_its_limits(capsys):
    wear = ("scatter.wear_coefficient={lognormal={factor=2.0}}", "scatter.samples=8", "axes.excitation_amplitude=10")
    given = (*CHEAP, *wear, "axes.scheme=adaptive", "outputs.variables=['response_amplitude']")
    first = compute("sdof_slider", "o.nc", *given, "scatter.limits={wear_depth=1e-3}")
    depths = np.sort(first.wear_depth_max.values[..., -1].ravel())
    capsys.readouterr()
    limit = f"scatter.limits={{wear_depth={0.5 * (depths[5] + depths[6])}}}"
    compute("sdof_slider", "p.nc", *given, limit)
    assert "6 of 8 samples" in capsys.readouterr().out
    # the other half of the same question: how many last so long
    end = f"slow_time.until={{wear_depth={0.5 * (depths[2] + depths[3])}}}"
    lives = compute("sdof_slider", "q.nc", *given, end, "scatter.limits={cycles_to_target=1.5e3}")
    n_old = int((~(lives.cycles_to_target < 1.5e3)).sum())
    said = capsys.readouterr().out
    assert f"{n_old} of 8 samples" in said
    assert "samples last" in said


@pytest.mark.slow
def test_axes_and_samples_stand_side_by_side_and_the_result_is_the_study_again():
    axes = ("axes.friction_coefficient=[0.4, 0.6]", "axes.threshold=[0, 5]")
    given = (*CHEAP, "scatter.samples=2", FRICTION, WEAR, "wear.law=threshold", *axes)
    first = compute("sdof_slider", "first.nc", *given)
    assert first.worn_volume.dims[-4:] == ("friction_coefficient", "threshold", "sample", "cycle")
    assert first.sample_friction_coefficient.dims == ("friction_coefficient", "sample")
    variants = read_study("sdof_slider", given).variants
    drawn = [draw_inputs(variant)["friction_coefficient"] for variant in variants[::2]]
    np.testing.assert_array_equal(first.sample_friction_coefficient, drawn)
    xr.testing.assert_identical(compute("first.nc", "second.nc").drop_attrs(), first.drop_attrs())


@pytest.mark.slow
def test_a_saltelli_design_of_wear_coefficient_and_factor_of_a_surface():
    """The volume is k_w c N times a constant where nothing depends on wear."""
    sliding = ("scene.normal_stiffness=0", "axes.wear_coefficient=1e-11", "wear.surfaces={support=0.5}")
    surface = "scatter.surfaces={support={lognormal={factor=1.3}}}"
    given = (*CHEAP, "axes.step=2000", *sliding, "scatter.method=saltelli", "scatter.samples=4", WEAR, surface)
    assert len(plan_of(read_study("sdof_slider", given), 2).sweeps) == 1, "all samples start from one state"
    samples = compute("sdof_slider", "w.nc", *given)
    assert samples.sizes["sample"] == 4 * 4
    ratio = samples.worn_volume[..., -1] / (samples.sample_wear_coefficient * samples.sample_surfaces_support)
    assert float(ratio.std() / ratio.mean()) < 1e-9
    assert len(np.unique(samples.worn_volume[..., -1])) > 8


def test_drawn_gaps_stand_along_the_axes_along_which_pairs_differ():
    gap = "scatter={samples = 2, gap = {normal = {std = 1e-9}, of = 'each pair'}}"
    axes = ("axes.strips=[20, 10]", "axes.E=[1e11, 2e11]", "scene.half_width=1e-3")
    study = read_study("cylinder_on_flat", [*axes, gap])
    scenes = find_scenes(study)
    facts = [describe_scene(build_study_scene(each)) for each in scenes.studies]
    (found,) = sample_coordinates(study, facts, scenes)
    assert found.entry.dimensions == ("strips", "sample", "contact")
    assert np.isfinite(found.values).sum(axis=-1).tolist() == [[10, 10], [5, 5]], "half of the strips, by symmetry"
