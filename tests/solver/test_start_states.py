"""Start states: static and first ones; each is that of its own point, whatever else is asked for; folds."""

import re
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from solver import frequency_response, march_wear
from solver.accuracy.refinement import VIBRATION_RECHECK
from solver.accuracy.resolved_state import left_out
from solver.continuation.first_state import state_at_rest
from solver.continuation.natural import follow_naturally, ratchets
from solver.harmonic_balance.state import State, balance_after
from solver.loading_history import path as path_module
from solver.loading_history import sweep as sweep_module
from solver.loading_history.path import LoadingPath
from solver.loading_history.start_states import FIRST_ITERATIONS, OTHER_START
from solver.newton.run import Run, guarded
from solver.outcome import Outcome
from solver.packing import Packed
from solver.settings import Resolution, SolverSettings, all_orders, allowed
from solver.structure.schur import condense
from tests.benchmarks.frame import measure
from tests.benchmarks.values import SCAR
from tests.random_decks import random_deck, run_deck, static_forces
from tests.random_scenes import random_scene
from tests.solver import models
from tests.solver.models import assert_same, branch_states, case_of, dovetail, scene, state_at, sweep_of

AUTOMATIC = SolverSettings()


def starts(frequencies, sweep="up", settings=AUTOMATIC):
    found = sweep_of(dovetail(13), 0.5, 0.5, sweep, settings).states(np.array(frequencies))
    return {frequencies[index]: start for index, start in found}


def slip_work(start):
    """Work of the mean friction forces on the vibration: what differs first where the history does."""
    motion, force = start.state.displacement_h[:, 1:], start.state.contact_force_h[:, 1:]
    return float(np.pi * (motion[..., 2::2] * force[..., 1::2] - motion[..., 1::2] * force[..., 2::2])[..., 0].sum())


@pytest.mark.slow
@pytest.mark.parametrize(("sweep", "others"), [("down", [211.1, 212.499, 212.501]), ("ramp", [212.499])])
def test_a_state_is_the_same_to_the_last_bit_whatever_else_is_asked_for(sweep, others):
    # near the resonance of the coarse sector, where it slips
    alone, together = (starts(sorted(each), sweep)[212.5] for each in ([212.5], [212.5, *others]))
    assert_same(together, alone)


@pytest.mark.slow
def test_pairs_slide_with_a_rising_load_alike_in_one_step_and_in_many():
    """Within 1.5 % of the slide, with one slide for each step 27 %."""
    omega, run = 1256.0, Run(1e-8)
    case = case_of(dovetail(13), 0.5, omega, SolverSettings(3, 64))
    rest = state_at_rest(case, omega, run)
    assert isinstance(rest, State)

    def balance_from(factor, state):
        return balance_after(case.joint(omega, 20.0 * factor), state)

    one, many = (follow_naturally(balance_from, rest, 1.0, run, fine=fine) for fine in (1.0, 1.0 / 64.0))
    assert one[1]
    assert many[1]
    slid = np.linalg.norm(many[0].next_history - rest.next_history)
    assert slid > 5e-6
    assert np.linalg.norm(one[0].next_history - many[0].next_history) < 0.03 * slid


@pytest.mark.slow
def test_the_error_holds_what_the_steps_of_the_sweep_leave_wrong(monkeypatch):
    # behind the resonance, with harmonics enough: what the reference sweep misses are its steps alone
    settings = SolverSettings(harmonics=9, samples=128)
    found = {}
    for change in (0.3, 0.02):
        monkeypatch.setattr(path_module, "CHANGE_LIMITS", (change, change))
        found[change] = starts([213.25], settings=settings)[213.25]
    coarse, fine = found[0.3], found[0.02]
    assert coarse.reference is not None
    wrong, seen = (
        np.linalg.norm((coarse.state.displacement_h - other.displacement_h)[:, :, 1:])
        for other in (fine.state, coarse.reference)
    )
    assert 1e-3 * np.linalg.norm(fine.state.displacement_h[:, :, 1:]) < wrong < 2.0 * seen
    assert abs(slip_work(coarse) / slip_work(fine) - 1.0) < coarse.wear_rate_error


@pytest.mark.slow
def test_a_joint_without_grip_ends_within_bounded_effort():
    """Two masses on a structure that friction alone keeps in place: no state stays, and the search for one ends."""
    model = scene("two_masses")
    loose = replace(model.linear[0], stiffness=np.array([[0.5, -1.0], [-1.0, 1.0]]))
    found = sweep_of(replace(model, linear={0: loose}), 0.5, 5.0, "up", AUTOMATIC).states(np.array([0.1]))
    ((_, start),) = found
    assert start.state is None
    assert start.outcome in (Outcome.UNSTABLE, Outcome.UNSETTLED, Outcome.ADRIFT)
    # to begin the sweep, and at the point; each ends with one solve under way
    assert start.newton_iterations < 3 * FIRST_ITERATIONS


INTERRUPTED = {
    "nodes and resolutions": (lambda: dovetail(13), 0.5, 0.5, [212.0, 212.6], "up"),
    "folds and settling in time": (lambda: scene("vibro_impact"), 0.0, 0.02, [0.2, 0.255], "up"),
    "masses on sliders": (lambda: scene("two_masses"), 0.5, 20.0, [0.1], "down"),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", INTERRUPTED)
def test_a_sweep_goes_on_from_each_save_to_the_last_bit(case, monkeypatch):
    """Also to a frequency that was passed before."""
    monkeypatch.setattr(sweep_module, "ITERATIONS_PER_SAVE", 5)
    build, friction, amplitude, frequencies, way = INTERRUPTED[case]
    asked, kept = (build(), friction, amplitude, way, AUTOMATIC), list[Packed | str]()
    whole = dict(sweep_of(*asked, kept.append).states(np.array(frequencies)))
    assert max(start.branch for start in whole.values()) == (1 if "folds" in case else 0)
    saved = [progress for progress in kept if not isinstance(progress, str)]
    assert len(saved) > 2 * len(whole)
    for progress in saved[1 :: len(saved) // 4 + 1]:
        sweeps = sweep_of(*asked)
        sweeps.load(progress)
        again = dict(sweeps.states(np.array(frequencies)))
        for index, wanted in whole.items():
            assert_same(again[index], wanted)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sweep", "omegas", "fold"), [("up", [1.5, 1.54, 1.58, 1.65], 1.5576), ("down", [1.0, 1.05, 1.12, 1.2], 1.09195)]
)
def test_a_fold_is_found_and_the_branch_behind_it_counted(sweep, omegas, fold):
    starts = branch_states(scene("vibro_impact"), 0.0, 0.02, omegas, SolverSettings(harmonics=21, samples=256), sweep)
    in_order = starts if sweep == "up" else starts[::-1]
    assert [start.outcome for start in starts] == [Outcome.CONVERGED] * 4
    assert [start.branch for start in in_order] == [0, 0, 1, 1]
    folds = [2 * np.pi * start.fold_frequency for start in in_order]
    # the last fold before a point is that of all points behind it; the exact motions end between 1.5575 and 1.558, and
    # between 1.092 and 1.0915 rad/s
    assert folds == pytest.approx([np.nan, np.nan, fold, fold], rel=1e-4, nan_ok=True)
    with_impacts = [bool(start.state.contact_force_h.any()) for start in in_order]
    assert with_impacts == [sweep == "up"] * 2 + [sweep == "down"] * 2


@pytest.mark.parametrize(
    ("highest", "foreseen", "suits"), [(3, 0.9, True), (3, 1.1, False), (5, 0.9, True), (5, 0.2, False)]
)
def test_the_harmonics_of_a_node_are_checked_by_the_force_that_they_leave_out(highest, foreseen, suits):
    """The error where they were chosen grows with this force: an error above rtol, or far below, asks for others."""
    case = case_of(models.random_model(2, ("3d",) * 5), 0.4, 600.0, AUTOMATIC, Resolution(all_orders(highest), 64))
    path, found = LoadingPath(case, 30.0, 600.0), [models.first_point(case, 600.0, load) for load in (15.0, 30.0)]
    checked, state = (replace(each, parameter=part) for each, part in zip(found, (0.5, 1.0), strict=True))
    before, now = left_out(checked), left_out(state)
    assert path.differs(checked, state) > VIBRATION_RECHECK
    assert not path.rests(state)
    assert not path.forgets(state)
    assert 0.0 < before < now
    assert path.suits(checked, foreseen * AUTOMATIC.rtol * before / now, state) == suits


def test_a_structure_that_is_singular_with_its_joint_held_is_said_to_be():
    # Mass 1 between two springs, mass 2 held: K + i w C - w^2 M is exactly zero at 2 rad/s.
    model = scene("two_masses", stiffness_1=3.0, stiffness_2=1.0, damping_1=0.0, damping_2=0.0)
    frequency = 2.0 / (2 * np.pi)
    assert 2 * np.pi * frequency == 2.0
    starts = dict(sweep_of(model, 0.5, 20.0, "up", SolverSettings(3, 64)).states(np.array([frequency])))
    assert starts[0].outcome is Outcome.SINGULAR
    assert starts[0].state is None
    assert f"at {frequency:.6g} Hz" in starts[0].message


@pytest.mark.parametrize("fails", [np.linalg.inv, np.linalg.eigvals])
def test_what_else_fails_in_linear_algebra_is_no_singular_structure(fails):
    found = guarded(lambda: [fails(np.full((2, 2), value)) for value in (0.0, np.nan)])
    assert found.outcome is Outcome.EXCEPTION
    assert re.match(r"LinAlgError: .* \(.*test_start_states.py, line", found.message)


def test_a_curve_of_a_slider_takes_few_iterations():
    """490 of them; 729 without the sliding start of its five sweeps."""
    curve = partial(frequency_response, scene("sdof_slider"), np.linspace(120.0, 250.0, 27), 10.0, 0.5)
    assert measure(curve).iterations < 550


PRESS = 200.0  # N on each pair: with it the glued dovetail pulls nowhere


def test_beyond_the_friction_that_holds_all_pairs_the_static_state_is_the_glued_one():
    # so much more load on the flanks that all pairs of the glued structure are pressed
    model = dovetail()
    load = model.linear[0].load_static.copy()
    load[model.contact.dofs[:, 0]] += PRESS
    linear = replace(model.linear[0], load_static=load)
    model = replace(model, linear={0: linear})
    condensed = condense(np.real(linear.stiffness), model.contact.dofs.ravel(), linear.load_static)
    force = np.real(condensed.force).reshape(-1, 3)
    # from this friction coefficient on the glued structure slips nowhere
    needed = float((np.hypot(force[:, 1], force[:, 2]) / force[:, 0]).max())
    assert 1.5 < needed < 100.0, "the test means nothing"
    for friction in (1.01 * needed, 1000.0):
        assert np.abs(static_forces(model, friction) - force).max() < 1e-7 * force.max()
    assert np.abs(static_forces(model, 0.7 * needed) - force).max() > 1e-3 * force.max()


STATIC = {
    # of the last one the shear is 88 % of what friction holds
    Outcome.CONVERGED: (0, 2, 3, 14, 18, 56),
    # 115 %
    Outcome.STATIC_SLIDING: (9, 45),
    Outcome.STATIC_OPEN: (1, 26, 31),
}
"""Seeds of random decks."""


@pytest.mark.parametrize(("outcome", "seed"), [(outcome, seed) for outcome, seeds in STATIC.items() for seed in seeds])
def test_random_decks_have_a_static_state_where_the_forces_can_balance_or_say_why_not(outcome, seed):
    exists, found, errors = run_deck(random_deck(seed))
    assert found is outcome
    assert exists == ("possible" if outcome is Outcome.CONVERGED else "impossible")
    assert max(errors.values(), default=0.0) < 1e-7


def test_a_free_block_needs_no_friction_where_it_is_pressed_on_and_is_pulled_off():
    deck = random_deck(35)
    linear = deck.model.linear[0]
    exists, found, errors = run_deck(replace(deck, friction=0.0))
    assert (exists, found, max(errors.values()) < 1e-7) == ("possible", Outcome.CONVERGED, True)
    pulled = replace(deck.model, linear={0: replace(linear, load_static=-linear.load_static)})
    assert run_deck(replace(deck, model=pulled))[:2] == ("impossible", Outcome.STATIC_OPEN)


@pytest.mark.slow
def test_a_response_that_its_sweep_leaves_above_rtol_is_inaccurate(monkeypatch):
    monkeypatch.setattr(path_module, "CHANGE_LIMITS", (0.4, 0.4))
    model, named = scene("dovetail_sector", mesh=1), {"wear_depth": SCAR, "settings": SolverSettings(rtol=5e-3)}
    swept = frequency_response(model, [212.5], 0.5, 0.5, **named)
    still = march_wear(model, 212.5, 0.5, 0.5, 1e-11, 0.0, **named)
    assert (swept.outcome[0], still.outcome) == (Outcome.INACCURATE, Outcome.INACCURATE)
    assert min(swept.response_error[0], still.response_error[0]) > 5e-3


def test_a_mass_that_slides_all_the_time_needs_no_reference_sweep():
    ((_, start),) = sweep_of(scene("sdof_slider"), 0.5, 10.0, "up", SolverSettings()).states(np.array([160.0]))
    assert start.reference is None
    assert 0.0 < start.response_error < 1e-2


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "slips"), [(160, False), (178, True), (371, False), (710, False)])
def test_states_whose_slip_was_ratcheting_are_found_and_slip_by_their_vibration_alone(seed, slips):
    scene = random_scene(seed)
    asked = scene.model, scene.friction, scene.amplitude, 2.0 * np.pi * scene.frequency_hz
    start, case, state = state_at(*asked, AUTOMATIC)
    assert start.outcome is Outcome.CONVERGED
    at = state.evaluation
    assert not ratchets(state.joint(case), at, 1e-3)
    # shaken down with 3 harmonics scene 710 slips 1e-12 N m on to where 9 have it, a thousand times what is left there
    assert (at.slip_work.sum() > 1e-13) == slips


@pytest.mark.slow
@pytest.mark.parametrize(
    ("frequency", "settings"), [(212.35, AUTOMATIC), (212.355, AUTOMATIC), (212.345, SolverSettings(39, 512))]
)
def test_the_error_is_told_near_where_slip_begins(frequency, settings):
    """Behind the last node, without slip and with three harmonics for 27 and 39; just behind the first with slip."""
    model, omega = scene("dovetail_sector", 39, mesh=1), 2.0 * np.pi * frequency

    def slip_work(settings):
        start, _, state = state_at(model, 0.5, 0.5, omega, settings)
        return state.evaluation.slip_work.sum(), start.wear_rate_error

    work, told = slip_work(settings)
    true = abs(slip_work(SolverSettings(39, 512, rtol=1e-3))[0] / work - 1.0)
    assert true > 0.04
    assert 0.7 * true < told < 4.0 * true


@pytest.mark.parametrize("lost", ["reference", "sweep"])
def test_a_state_whose_reference_sweep_is_lost_or_that_is_found_from_rest_has_an_unknown_error(lost, monkeypatch):
    """From rest the friction has another history than that of a sweep."""
    follow = sweep_module.follow

    def reference_lost(path, states, targets, *more, **named):
        return () if targets[-1] < 2.0 * np.pi * 212.42 else follow(path, states, targets, *more, **named)

    name, other = ("follow", reference_lost) if lost == "reference" else ("SWEEP_ITERATIONS", 0)
    monkeypatch.setattr(sweep_module, name, other)
    start = starts([212.5])[212.5]
    assert start.state is not None
    assert (start.outcome, start.wear_rate_error, start.reference) == (Outcome.INACCURATE, np.inf, None)


@pytest.mark.parametrize("harmonics", ["auto", 1, 31, 32, 40])
@pytest.mark.parametrize("samples", ["auto", 128])
def test_another_first_state_has_samples_for_its_harmonics(harmonics, samples):
    """With 32 given harmonics or more the 64 samples of the other start would not do: an error took its place."""
    found = allowed(OTHER_START, SolverSettings(harmonics, samples))
    assert found.samples > 2 * found.highest
    assert samples == "auto" or found.samples == samples
