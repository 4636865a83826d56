"""What is reported of states and histories: time signals, contact forces, fretting loops, outcomes."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from solver.accuracy.certificate import certify
from solver.outcome import Outcome
from solver.results.history import first_cut_off, judge
from solver.results.state_report import LOOP_PHASES, periodic_motion, periodic_state, report_state
from solver.settings import FINE_SAMPLES, SolverSettings
from solver.structure.fourier import build_basis
from studies import build_scene
from tests.solver.models import ALL_KINDS, branch_states, march_wear, scene, worn_state
from tests.solver.reconstruction import harmonic_structure, pair_period
from tests.studyrunner.faked_runs import history

FRICTION = 0.4
SETTINGS = SolverSettings(harmonics=3, samples=64, tolerance=1e-10)
KINDS = {"3d": ("3d",) * 3, "mixed": ALL_KINDS}


@pytest.mark.parametrize("kinds", KINDS)
def test_the_contact_force_is_that_of_the_plain_law(kinds):
    """From what the state stores; `test_whole_response` has the equation of motion."""
    joint, point = worn_state(KINDS[kinds], SETTINGS)
    model, penalty, state = joint.model, joint.penalty, periodic_state(point)
    assert not penalty.inertial.any()
    assert point.evaluation.slip_work.any()
    moved = state.displacement_h.copy()
    moved[:, 0, 0] -= model.contact.gap + point.evaluation.wear_depth
    eps = np.column_stack([penalty.normal, penalty.tangential, penalty.tangential])
    predicted_h = state.contact_force_h + eps[:, :, None] * moved
    predicted_h[model.contact.dofs[:, 0] < 0, 0, 1:] = 0.0
    predicted_t = predicted_h @ joint.basis.synthesis
    begin = penalty.tangential[:, None] * state.start_history
    pairs = zip(predicted_t, begin, strict=True)
    forces = np.array([pair_period(predicted, FRICTION, start, 8)[0] for predicted, start in pairs])
    size = np.abs(state.contact_force_h).max()
    assert forces[:, 1:] @ joint.basis.analysis == pytest.approx(state.contact_force_h[:, 1:], abs=1e-9 * size)
    # normal forces are averaged up to the instant of opening: near those of 64 times the samples, Eq. (11)
    finer = build_basis(joint.basis.orders, 64 * SETTINGS.samples)
    exact = np.maximum(predicted_h[:, 0] @ finer.synthesis, 0.0) @ finer.analysis
    kink = np.abs(np.diff(predicted_t[:, 0])).max()
    assert np.abs(state.contact_force_h[:, 0] - exact).max() < 4 * kink / SETTINGS.samples


@pytest.mark.parametrize("kinds", KINDS)
def test_the_report_is_that_of_the_time_signals(kinds):
    joint, point = worn_state(KINDS[kinds], SETTINGS)
    model, at = joint.model, point.evaluation
    report, whole = report_state(joint, at, certify(joint, at)), periodic_motion(joint, at).displacement
    responses = [harmonic_structure(model, n).response @ moved for n, moved in enumerate(whole.T)]
    assert report["response"] == pytest.approx(responses[1], rel=1e-8, abs=0.0)
    static = np.real(responses[0])
    phase = 2 * np.pi * np.arange(FINE_SAMPLES) / FINE_SAMPLES
    waves = sum(np.real(responses[n][:, None] * np.exp(1j * n * phase)) for n in (1, 2, 3))
    assert report["response_peak"] == pytest.approx(np.abs(static[:, None] + waves).max(axis=1), rel=1e-8, abs=0.0)
    pressure = at.force_h[:, 0, 0] / model.contact.area
    assert report["mean_pressure"] == pytest.approx(pressure, rel=1e-12, abs=0.0)
    assert report["open_fraction"] == pytest.approx((at.force_t[:, 0] == 0).mean(axis=1))
    used = np.linalg.norm(at.force_t[:, 1:], axis=1) / np.where(
        at.force_t[:, 0] > 0.0, FRICTION * at.force_t[:, 0], np.inf
    )
    assert report["friction_use"] == pytest.approx(used.max())
    assert used.max() == pytest.approx(1.0)
    slip = at.state_t / joint.penalty.tangential[:, None, None]
    for pair in range(model.contact.n_contact):
        distances = np.linalg.norm(slip[pair, :, :, None] - slip[pair, :, None, :], axis=0)
        assert report["slip_range"][pair] == pytest.approx(distances.max(), rel=1e-12, abs=1e-20)
        steps = np.linalg.norm(np.diff(slip[pair]), axis=0)
        pressure = 0.5 * (at.force_t[pair, 0] + np.roll(at.force_t[pair, 0], 1))
        assert at.slip_work[pair] == pytest.approx(steps @ pressure, rel=1e-12, abs=1e-20)
        power = FRICTION * (steps @ pressure) * joint.omega / (2 * np.pi) / model.contact.area[pair]
        assert report["friction_power"][pair] == pytest.approx(power, rel=1e-12, abs=1e-20)


WEAR = 1.1e-11  # 1/Pa
CYCLES = np.array([0.0, 2000.0, 8000.0, 14000.0, 16000.0])


@pytest.mark.parametrize("scheme", ["implicit", "adaptive"])
def test_the_loop_of_a_sliding_mass_is_a_rectangle_of_the_energy_that_friction_takes(scheme):
    model, settings = scene("sdof_slider", 9), SolverSettings(harmonics=9, samples=256)
    (start,) = branch_states(model, 0.5, 10.0, [2 * np.pi * 160.0], settings)
    history = march_wear(model, 0.5, start, WEAR, 8000.0, scheme, CYCLES, settings, loops=(0,))
    motion, force = history.loop_displacement[:, 0], history.loop_force[:, 0]
    assert motion.shape == force.shape == (CYCLES.size, LOOP_PHASES, 3)
    normal = 10.0 - 1e5 * history.wear_depth[:, 0]
    # the states of an adaptive history are as exact as its steps need
    exact = 1e-6 if scheme == "adaptive" else 1e-9
    assert force[..., 0] == pytest.approx(np.repeat(normal[:, None], LOOP_PHASES, 1), rel=exact, abs=0.0)
    assert motion[..., 0] == pytest.approx(np.repeat(history.wear_depth, LOOP_PHASES, 1), rel=1e-9, abs=1e-15)
    assert not motion[..., 2].any()
    assert not force[..., 2].any()
    # the force is at its limit but in the steps in which the mass turns, of both states that are interpolated
    share = np.abs(force[..., 1]) / (0.5 * force[..., 0])
    assert share.max() <= 1 + 1e-12
    assert np.count_nonzero(share < 1 - 1e-9, axis=1).max() <= 4
    # and against the motion
    velocity = np.roll(motion[..., 1], -1, axis=1) - np.roll(motion[..., 1], 1, axis=1)
    fast = np.abs(velocity) > 0.1 * np.abs(velocity).max()
    assert (velocity * force[..., 1] > 0.0)[fast].all()
    # 128 straight lines cut the corners of the rectangle, by the square of a step; only states of steps are exact
    mean = 0.5 * (force[..., 1] + np.roll(force[..., 1], -1, axis=1))
    work = np.sum(mean * (np.roll(motion[..., 1], -1, axis=1) - motion[..., 1]), axis=1)[[0, 2, 4]]
    assert work == pytest.approx(0.5 * history.wear_rate[[0, 2, 4]] / WEAR, rel=3e-3, abs=0.0)


ALL = np.arange(3)
UNKNOWN = {"worn_volume": 1e-9 * np.arange(3.0), "worn_volume_error": np.array([0.0, 0.1, 0.6])}
ALONE = {"worn_volume_error": np.array([0.0, np.inf, np.inf]), "reference_end": "lost"}


@pytest.mark.parametrize(
    ("rows", "changed", "outcome", "said"),
    [
        ([], {}, Outcome.CONVERGED, ""),
        (ALL, {"inaccurate_from": 4.0}, Outcome.INACCURATE, "from cycle 8 on the response is known to 2.6 % only"),
        ([0, 1], {"inaccurate_from": 5.0}, Outcome.CONVERGED, ""),
        # what is not known goes before harmonics, a contact that is cut off before both
        (ALL, {**UNKNOWN, "inaccurate_from": 0.0}, Outcome.SENSITIVE, "worn volume 2 mm3"),
        (ALL, {**UNKNOWN, "cut_off_cycle": 4.0}, Outcome.CONTACT_CUT_OFF, "pairs at the edge"),
        (ALL, {**UNKNOWN, "cut_off_cycle": 11.0}, Outcome.SENSITIVE, "worn volume 2 mm3"),
        # an unknown error is no large one
        (ALL, {**UNKNOWN, "worn_volume_error": np.full(3, np.inf)}, Outcome.INACCURATE, "is not known: "),
        (ALL, {**UNKNOWN, **ALONE}, Outcome.INACCURATE, "a coarser sweep the history ends early: lost"),
        (ALL, {**UNKNOWN, **ALONE, "undecided_from": 4.0}, Outcome.INACCURATE, "not known: at cycle 8 a pair ceases"),
        # the steps of an adaptive history aim at rtol
        ([0, 1], {**UNKNOWN, "adaptive": True}, Outcome.INACCURATE, "worn volume 1 mm3"),
        # a history that shares it and ends before is known
        ([0, 1], UNKNOWN, Outcome.CONVERGED, ""),
        # a joint that is held says so beside all else
        (ALL, {"held_from": 4.0}, Outcome.CONVERGED, "from cycle 8 on every pair slips"),
        (ALL, {"held_from": 4.0, "inaccurate_from": 0.0}, Outcome.INACCURATE, "; from cycle 8 on every pair slips"),
        ([0], {"held_from": 4.0}, Outcome.CONVERGED, ""),
    ],
)
def test_the_outcome_is_that_of_the_counts_that_are_judged(rows, changed, outcome, said):
    """Of a history at half the speed, whose volume at the last count is known to 6 %."""
    given = replace(history([0.0, 4.0, 10.0]), inaccurate_in="response", inaccurate_error=0.026, **changed)
    found = judge(given, np.asarray(rows, int), 1e-2, 0.5)
    assert found[0] is outcome
    assert said in found[1]
    assert bool(found[1]) is bool(said)


def test_load_or_wear_at_the_edge_is_found_at_its_first_count():
    contact = replace(build_scene("cylinder_on_flat", strips=6).contact, edge=np.array([False, False, True]))
    cycles, none = np.array([0.0, 10.0, 20.0, 30.0]), np.zeros((4, 3))
    middle = none + [2.0, 1.0, 0.0]
    at = none.copy()
    at[2:, 2] = 1e-3
    cut = partial(first_cut_off, contact, cycles)
    assert [cut(middle + at, middle), cut(middle, middle + at), cut(middle + 1.0, middle)] == [20.0, 20.0, 0.0]
    # of counts without a state nothing is known
    gone, lost = middle + at, middle + at
    gone[2], lost[2:] = np.nan, np.nan
    assert cut(gone, middle) == 30.0
    # round-off is no load, and an edge that is none does not count
    nowhere = first_cut_off(replace(contact, edge=None), cycles, middle + at, middle)
    assert np.isnan([cut(middle, middle), cut(middle + 1e-9 * at, middle), nowhere, cut(lost, middle)]).all()
