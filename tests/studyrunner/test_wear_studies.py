"""Wear histories from the study file to the result: laws, targets, the end of wear, a followed frequency, shortcuts."""

from pathlib import Path

import numpy as np
import pytest

from studyrunner import open_result
from studyrunner.accessor import join_results
from studyrunner.cli import main
from studyrunner.kinds.wear.kind import CERTIFICATE, LOOPS, OF_A_HISTORY, USUAL
from studyrunner.report.figures.wear import draw_excitation
from studyrunner.result.opening import open_known
from studyrunner.result.view import open_for_report
from studyrunner.study.study_file import read_study
from studyrunner.summary.answer import summary
from tests.mpi.launching import options
from tests.studyrunner.fakes import plan_of
from tests.studyrunner.small_studies import UNWORN, compute

pytestmark = [pytest.mark.usefixtures("folder"), pytest.mark.slow]


def run(*overrides):
    return compute("sdof_slider", "out.nc", *overrides)


# --- [wear] ---

SHORT = ("axes.frequency=160", "axes.scheme=adaptive", "slow_time.cycles=20000", "slow_time.outputs=3")
TABLE = ("wear.law=table", "wear.pressure=[1e4, 1e5]", "wear.depth=[0, 1e-5]", "wear.factor=[[1, 2], [0.5, 1]]")


def test_the_law_of_a_study_is_the_one_that_wears():
    def final(*overrides):
        return np.asarray(run(*SHORT, *overrides).worn_volume.isel(cycle=-1).values.ravel())

    archard = final()
    for same in ("wear.law=energy", "wear.surfaces={support=0.5}"):
        assert final(same, "axes.wear_coefficient=2.2e-11") == pytest.approx(archard, rel=1e-12)
    assert 0.0 < final("wear.law=threshold", "wear.threshold=10") < 0.9 * archard
    assert not final("wear.law=threshold", "wear.threshold=1e4").any()
    # one history for all wear coefficients: worn volumes are those of products of coefficient and cycles
    shared = final(*TABLE, "axes.wear_coefficient=[1.1e-11, 5.5e-12]")
    half = final(*TABLE, "axes.wear_coefficient=1.1e-11", "slow_time.cycles=10000")
    assert shared[1] == pytest.approx(half[0], rel=1e-3)
    assert abs(shared[0] / archard[0] - 1.0) > 0.01
    # another share of it is left where friction is powerful
    power, half = ("wear.law=power", "wear.adhesive=2e-12", "wear.decay=1e-3"), "axes.wear_coefficient=5.5e-12"
    both = final(*power, "axes.wear_coefficient=[1.1e-11, 5.5e-12]")
    assert both[1] == final(*power, half)[0] > 0.6 * both[0]


EVOLVING = """
[study]
name = "evolving"
[scene]
model = "sdof_slider"
[axes]
frequency = 160
excitation_amplitude = 10
wear_coefficient = [1e-12, 1e-30]
[wear.evolution]
energy = [0, 1e5]
friction_coefficient = [0.3, 0.5]
[slow_time]
cycles = 20000
outputs = 3
"""


def test_a_contact_evolves_on_from_where_a_result_has_left_it():
    """As one history: a joint that is mounted worn begins with its depths and its energies, archived or not."""
    Path("evolving.toml").write_text(EVOLVING)
    whole = compute("evolving.toml", "out.nc")
    assert {"dissipated_energy", "dissipated_energy_error", "pair_friction"} <= set(whole.data_vars)
    assert not np.isfinite(whole.pair_stiffness).any()
    friction, energy = (whole[name].values[..., 0].reshape(2, 3) for name in ("pair_friction", "dissipated_energy"))
    assert friction == pytest.approx(np.interp(energy, [0.0, 1e5], [0.3, 0.5]), rel=1e-12)
    # nothing wears with the second coefficient, and friction changes all the same
    assert energy[:, 1].min() > 1e3
    worn = "scene.worn={result='out.nc', cycle=10000, wear_coefficient=1e-12}"
    rest = "axes.wear_coefficient=1e-12", worn, "slow_time.cycles=10000", "slow_time.outputs=2"
    later = compute("evolving.toml", "later.nc", *rest)
    assert later.pair_friction.values.ravel() == pytest.approx(friction[0, 1:], rel=2e-3)
    assert read_study("later.nc").evolving == read_study("out.nc").evolving
    # once more: with what the later result began with, too
    third = compute("evolving.toml", "third.nc", rest[0], "scene.worn={result='later.nc', cycle=10000}", *rest[2:])
    assert third.worn_depth.item() == pytest.approx(whole.wear_depth.values[..., 0].reshape(2, 3)[0, 2], rel=5e-3)
    assert third.pair_friction.values.ravel()[0] == pytest.approx(friction[0, 2], rel=2e-3)
    assert "um at pair 0 with the wear before" in str(third.fretwear.summary()).replace("\n            ", " ")
    # a rigid contact has an infinite stiffness, and a report
    assert np.isinf(open_known("out.nc").pair_stiffness).all()


MODES = """
[study]
name = "modes"
[scene]
model = "sdof_slider"
{scene}
[axes]
modal_amplitude = [5e-5, 1e-4]
sweep = "down"
{wear}
"""


def test_modes_are_those_of_the_joint_that_has_evolved():
    tables = "[wear.evolution]\nenergy = [0, 1e5]\nfriction_coefficient = [0.3, 0.5]"
    worn = "worn = {depth = [[0.0], [0.0]], energy = [[0.0], [5e4]], cycle = [0, 100]}"
    Path("evolved.toml").write_text(MODES.format(scene=worn, wear=tables))
    evolved = compute("evolved.toml", "evolved.nc")
    for friction, found in zip((0.3, 0.4), evolved.transpose("cycle", ...).damping_ratio.values, strict=True):
        Path("plain.toml").write_text(MODES.format(scene=f"friction_coefficient = {friction}", wear=""))
        plain = compute("plain.toml", "plain.nc")
        assert found.ravel() == pytest.approx(plain.damping_ratio.values.ravel(), rel=1e-9)


# --- where slip begins ---


def test_slip_begins_where_the_joint_that_sticks_says():
    """Of a slider at friction times load; of a dovetail, whose pairs come to rest, near the end of rest."""
    rest = ("slow_time.cycles=0", "slow_time.outputs=1", "axes.scheme=adaptive")
    slider = run(*rest, "axes.frequency=150", "axes.excitation_amplitude=[1, 3, 6]")
    np.testing.assert_allclose(slider.slip_amplitude.values.ravel(), [5.0, 5.0, np.nan], rtol=1e-9)
    root = (*rest, "scene.mesh=1", "axes.frequency=200", "axes.wear_coefficient=1e-11", "solver.rtol=1e-2")
    far = compute("dovetail", "far.nc", *root, "axes.excitation_amplitude=[1, 11, 12.5]")
    first, near, slips = far.slip_amplitude.values.ravel()
    assert first == pytest.approx(12.0, rel=0.3)
    assert near == pytest.approx(12.0, rel=0.08)
    assert np.isnan(slips)
    assert far.slip_range.max(("cycle", "contact")).values.ravel().astype(bool).tolist() == [False, False, True]


# --- where histories end ---


def test_points_end_at_their_target_each_at_its_own_count():
    several = ("axes.wear_coefficient=[1e-11, 5e-12, 1e-12]", "slow_time.cycles=100000", "slow_time.outputs=101")
    whole = run(*SHORT, *several, "slow_time.until={wear_depth=1e-5}")
    result = whole.squeeze([name for name in whole.outcome.dims if name != "wear_coefficient"], drop=True)
    counts, errors = result.cycles_to_target.values, result.cycles_to_target_error.values
    assert counts[1] == pytest.approx(2.0 * counts[0], rel=1e-9)
    assert errors[1] == pytest.approx(2.0 * errors[0], rel=1e-9)
    assert 0.0 < errors[0] < 0.05 * counts[0]
    assert np.isnan([counts[2], errors[2]]).all()
    assert result.outcome.values.tolist() == [0, 0, 0]
    life = summary(whole).values["life"]
    assert (life["count"], life["error"], life["n_beyond"]) == (counts[0], errors[0], 1)
    for message, words_of in zip(result.message.values, ("at its target", "at its target", "stays below"), strict=True):
        assert words_of in message
    assert result.worn_volume.isel(cycle=-1).isnull().values.tolist() == [True, True, False]
    depth = result.wear_depth.isel(contact=0)
    # the history ends with the step in which it reaches its target, between two outputs
    known = depth.isel(wear_coefficient=0).dropna("cycle").interp(cycle=counts[0], kwargs={"fill_value": "extrapolate"})
    assert float(known) == pytest.approx(1e-5, rel=1e-3)
    assert (result.last_cycle[:2] >= result.cycles_to_target[:2]).all()
    # nothing wears, nothing is reached
    still = run(*SHORT, "axes.wear_coefficient=0", "slow_time.until={worn_volume=1e-12}")
    assert np.isnan(still.cycles_to_target.item())
    assert "stays below 1e-12" in still.message.item()


END = ("axes.frequency=160", "axes.sweep=ramp", "slow_time.cycles=inf", "slow_time.outputs=6", "solver.harmonics=3")
END += ("solver.samples=64",)


def test_points_to_the_end_have_counts_of_their_own_in_file_report_and_archive():
    several = ("axes.wear_coefficient=[1.1e-11, 2.2e-12, 0.0]", "axes.scheme=['adaptive', 'implicit']")
    result = run(*END, *several, "axes.step=2000", "outputs.loops=[0]")
    one = result.squeeze([name for name in result.outcome.dims if result.sizes[name] == 1], drop=True)
    assert one.outcome.values.tolist() == [[0, 0]] * 3
    assert one.cycle.values.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]
    assert one.cycle_count.dims == ("wear_coefficient", "scheme", "cycle")
    counts, volumes = one.cycle_count.values, one.worn_volume.values
    assert not counts[:, :, 0].any()
    assert (np.diff(counts[:2], axis=-1) > 0.0).all()
    assert volumes[:2, ..., -1] == pytest.approx(np.full((2, 2), 1e-4 * 1e-4), rel=1e-3)
    way = volumes[:2] / volumes[:2, ..., -1:] + counts[:2] / counts[:2, ..., -1:]
    assert np.diff(way, axis=-1) == pytest.approx(np.full((2, 2, 5), 2.0 / 5.0), rel=1e-6)
    # the same history of both coefficients, five times as slow; nothing wears without one
    assert counts[1, 0] == pytest.approx(5.0 * counts[0, 0])
    assert one.wear_rate.values[1, 0] == pytest.approx(one.wear_rate.values[0, 0] / 5.0)
    assert one.last_cycle.values[:2] == pytest.approx(counts[:2, :, -1])
    assert not counts[2].any()
    assert not volumes[2].any()
    # other steps where they are five times as short in wear
    assert volumes[1, 1, -1] == pytest.approx(volumes[0, 1, -1], rel=1e-4)
    with open_result("out.nc") as opened:
        assert np.array_equal(opened.cycle_count.values, result.cycle_count.values)
    shown = open_for_report("out.nc")
    assert np.array_equal(shown.cycles, shown.counts(shown.shown))
    assert shown.cycles[-1] in counts[:, :, -1]
    shown.dataset.close()
    with pytest.raises(ValueError, match="joins only those"):
        join_results([result, result.drop_vars("cycle_count")])


def test_the_scheme_final_is_computed_once_for_all_coefficients_and_steps():
    several = ("axes.wear_coefficient=[1.1e-11, 1e-12]", "axes.scheme=['adaptive', 'final']", "axes.step=[10, 100]")
    assert len(plan_of(read_study("sdof_slider", (*END, *several)), 2).results) == 1
    result = run(*END, *several).squeeze(drop=True)
    assert (result.outcome == 0).all()
    assert np.array_equal(result.worn_volume.sel(scheme="final"), result.worn_volume.sel(scheme="adaptive"))
    rates = result.wear_rate.sel(scheme="final").isel(cycle=0, step=0).values
    assert rates[0] == pytest.approx(11.0 * rates[1])


# --- a frequency that is followed ---

FOLLOWED = (
    *("axes.frequency=resonance", "loading.between=[180.0, 230.0]", "scene.damping=20.0", "axes.scheme=adaptive"),
    *("axes.excitation_amplitude=10.0", "slow_time.cycles=4e4", "slow_time.outputs=5", "solver.harmonics=3"),
    *("solver.samples=64", "axes.wear_coefficient=1.1e-11"),
)


def test_the_frequency_of_each_count_is_in_the_result_and_in_the_report(capsys):
    found = run(*FOLLOWED, "axes.wear_coefficient=[1.1e-11, 5.5e-12]")
    assert found.frequency.values.tolist() == [205.0]
    followed = found.excitation_frequency.squeeze()
    assert followed.dims == ("wear_coefficient", "cycle")
    assert followed.units == "Hz"
    assert (np.diff(followed) > 0.0).all()
    # half the wear coefficient wears half as fast
    np.testing.assert_allclose(followed[1, ::2], followed[0, :3], rtol=1e-12)
    assert (found.excitation_frequency_error > 0.0).all()
    assert f"moved from {followed[0, 0].item():.6g} to {followed[0, -1].item():.6g} " in capsys.readouterr().out
    shown = open_for_report("out.nc")
    figure, *_ = draw_excitation(shown)
    for line, expected in zip(figure.axes[0].get_lines(), followed.values, strict=True):
        np.testing.assert_array_equal(line.get_ydata(), expected)
    # the middle of the range is no frequency of the point
    assert "205" not in shown.describe(shown.shown, ["frequency"])
    shown.dataset.close()


def test_each_scene_and_each_sample_has_its_own_frequency():
    of_scenes = run(*FOLLOWED, *UNWORN, "axes.mass=[0.1, 0.11]")
    one, other = of_scenes.excitation_frequency.squeeze().values
    assert 198.0 < one < 201.0
    np.testing.assert_allclose(of_scenes.response_phase, -0.5 * np.pi, atol=1e-7)
    assert ((of_scenes.excitation_frequency_error > 0.0) & (of_scenes.excitation_frequency_error < 1.0)).all()
    # friction hardly moves the resonance from that of the mass on its spring
    assert one / other == pytest.approx(np.sqrt(1.1), rel=5e-3)
    samples = run(*FOLLOWED, *UNWORN, "scatter.samples=4", "scatter.mass={uniform={half_width=0.01}}")
    square = samples.excitation_frequency.squeeze() ** 2 * samples.sample_mass
    np.testing.assert_allclose(square, one**2 * 0.1, rtol=1e-2)
    assert float(samples.excitation_frequency.std()) > 1.0


# --- what is left out because it is the same is the same ---

STUDY = (
    *("axes.frequency=[100.0, 160.0]", "axes.wear_coefficient=[1e-12, 0, 1e-11, 4e-12]", "axes.step=[100, 250, 1000]"),
    *("axes.scheme=['implicit', 'explicit', 'adaptive']", "slow_time.cycles=4000", "outputs.loops=[0]"),
    "slow_time.outputs=[0, 130, 1000, 4000]",
)
FEWER = ("axes.frequency=160", "axes.scheme=['explicit', 'adaptive']")
COMPARED = [name for name in (*USUAL, *LOOPS, *OF_A_HISTORY) if name not in ("newton_iterations", "run_time")]


def check_same(name, short, long):
    """To round-off; violations are relative themselves, and what is left of them where they vanish is round-off."""
    if short[name].dtype.kind in "OU":
        assert (short[name] == long[name]).all(), name
        return
    round_off = 1e-9 if name in CERTIFICATE else 1e-6 * float(abs(long[name]).max()) if name in LOOPS else 0.0
    if name == "response_mean":
        # a response that swings around zero
        round_off = 1e-9 * float(long["response_amplitude"].max())
    found, expected = short[name].astype(float), long[name].astype(float)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=round_off, err_msg=name)


@pytest.mark.parametrize(
    "overrides",
    [(), (*FEWER, "axes.wear_coefficient=1e-11", "slow_time.largest_depth=2e-8"), (*FEWER, *UNWORN)],
    ids=["shared histories", "largest depth", "no cycles"],
)
def test_a_study_with_shortcuts_is_one_without(overrides):
    short, long = run(*STUDY, *overrides), run(*STUDY, *overrides, "solver.shortcuts=false")
    for name in COMPARED:
        check_same(name, short, long)
    worn = short.worn_volume.isel(cycle=-1).sel(frequency=160.0)
    assert (worn.where(short.wear_coefficient > 0.0, drop=True) > 0.0).all() == (UNWORN[0] not in overrides)
    force = long.loop_force.isel(component=0).mean("phase")
    np.testing.assert_allclose(force, long.mean_pressure * long.contact_area, rtol=1e-9)


def test_every_point_without_a_resonance_says_why(capsys):
    # so little excitation that the slider sticks: its resonance is far above the range
    small = ("axes.excitation_amplitude=1.0", "slow_time.cycles=10.0", "scatter.samples=2")
    scatter = "scatter.excitation_amplitude={uniform={half_width=0.1}}"
    assert main(["sdof_slider", "-o", "out.nc", *options(*FOLLOWED, *small, scatter)]) == 3
    said = " ".join(capsys.readouterr().out.split())
    with open_result("out.nc") as result:
        messages = {str(message) for message in result.message.values.ravel()}
    (message,) = messages
    assert "between 180 and 230 Hz" in message
    assert "another axes.sweep" in said
    assert "ramp" not in said
    assert "205 Hz" not in said
