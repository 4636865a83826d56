"""A start state is that of its own point: whatever else is asked for, in whatever steps."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from solver.loading_history import path as path_module
from solver.loading_history import sweep as sweep_module
from solver.loading_history.frequency_sweep import FIRST_ITERATIONS, FrequencySweep
from solver.loading_history.start_states import follow_branch
from solver.loading_history.sweep_start import cell_of, find_origin
from solver.outcome import Outcome
from solver.packing import Packed
from solver.results.history import StartState
from solver.settings import SolverSettings
from tests.solver.models import dovetail, scene

AUTOMATIC = SolverSettings()
BESIDE = 212.5  # Hz: near the resonance of the coarse sector, where it slips


def starts(frequencies, sweep="up", settings=AUTOMATIC):
    found = follow_branch(dovetail(13), 0.5, 0.5, np.array(frequencies), sweep, settings)
    return {frequencies[index]: start for index, start in found}


@lru_cache
def alone(sweep="up"):
    return starts([BESIDE], sweep)[BESIDE]


@lru_cache
def followed():
    """A sweep up past the frequency: the state at each, and what was kept of its progress behind each."""
    frequencies = np.array([211.0, 212.0, 212.25, BESIDE, 212.75])
    found: dict[float, StartState] = {}
    kept: dict[float, Packed] = {}

    def note(progress):
        if not isinstance(progress, str):
            kept[max(found, default=0.0)] = progress

    for index, start in follow_branch(dovetail(13), 0.5, 0.5, frequencies, "up", AUTOMATIC, keep=note):
        found[float(frequencies[index])] = start
    return found, kept


def assert_same_state(one, other):
    """To the last bit."""
    assert np.array_equal(one.state.displacement_h, other.state.displacement_h)
    assert np.array_equal(one.state.start_history, other.state.start_history)
    assert (one.response_error, one.branch) == (other.response_error, other.branch)


def slip_work(start):
    """Work of the mean friction forces on the vibration: what differs first where the history does."""
    motion, force = start.state.displacement_h[:, 1:], start.state.contact_force_h[:, 1:]
    return float(np.pi * (motion[..., 2::2] * force[..., 1::2] - motion[..., 1::2] * force[..., 2::2])[..., 0].sum())


@pytest.mark.slow
@pytest.mark.parametrize("sweep", ["down", "ramp"])
def test_a_state_is_the_same_to_the_last_bit_whatever_else_is_asked_for(sweep):
    others = [211.1, 212.499, 212.501]
    assert_same_state(starts(sorted([*others, BESIDE]), sweep)[BESIDE], alone(sweep))


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
def test_a_sweep_goes_on_to_the_last_bit():
    whole, kept = followed()
    left = np.array([BESIDE, 212.75])
    again = dict(follow_branch(dovetail(13), 0.5, 0.5, left, "up", AUTOMATIC, resume=kept[212.25]))
    for index, frequency in enumerate(left):
        assert_same_state(again[index], whole[float(frequency)])


@pytest.mark.slow
def test_progress_beyond_a_frequency_is_not_used_for_it():
    _, kept = followed()
    ((_, again),) = follow_branch(dovetail(13), 0.5, 0.5, np.array([BESIDE]), "up", AUTOMATIC, resume=kept[212.75])
    assert_same_state(again, alone())


@pytest.mark.parametrize("sweep", ["up", "down"])
def test_a_sweep_begins_away_from_its_points_and_from_resonances(sweep):
    model = dovetail()
    for frequency in np.linspace(100.0, 500.0, 41):
        origin = find_origin(model, cell_of(float(frequency)), sweep)
        for start in origin.starts[:2]:
            ratio = start / frequency
            assert 0.49 < ratio <= 0.7001 if sweep == "up" else 1.2999 <= ratio < 1.86
        assert 1.0 <= origin.penalty / frequency < 1.2
        assert all(abs(start / resonance - 1.0) > 0.01 for start in origin.starts[:1] for resonance in (212.9, 411.0))


@pytest.mark.slow
def test_a_joint_without_grip_ends_within_bounded_effort():
    """Two masses on a structure that friction alone keeps in place: no state stays, and the search for one ends."""
    model = scene("two_masses")
    loose = replace(model.linear[0], stiffness=np.array([[0.5, -1.0], [-1.0, 1.0]]))
    found = follow_branch(replace(model, linear={0: loose}), 0.5, 5.0, np.array([0.1]), "up", AUTOMATIC)
    ((_, start),) = found
    assert start.state is None
    assert start.outcome in (Outcome.UNSTABLE, Outcome.UNSETTLED, Outcome.ADRIFT)
    # to begin the sweep, to begin it anew, and at the point; each ends with one solve under way
    assert start.newton_iterations < 4 * FIRST_ITERATIONS


def test_a_first_state_that_more_harmonics_refuse_begins_no_sweep(monkeypatch):
    monkeypatch.setattr(sweep_module.Sweep, "_choose_resolution", lambda _: 0.6)
    nodes = FrequencySweep(scene("sdof_slider"), 0.3, 1.0, "up", AUTOMATIC).sweep_to(100.0)
    assert nodes.here is None
    assert nodes.state.failure is Outcome.UNSETTLED


class KilledError(BaseException):
    """The end of a run, in the middle of its work."""


def in_short_runs(model, friction, amplitude, frequencies, way):
    """The start states from runs that all end at their second save, and the number of runs."""
    found: dict[int, StartState] = {}
    saved: list[Packed] = []
    for n_runs in range(1, 1000):
        n_saves = 0

        def keep(progress):
            nonlocal n_saves
            if isinstance(progress, str):
                return
            saved[:], n_saves = [progress], n_saves + 1
            if n_saves == 2:
                raise KilledError

        left = [index for index in range(frequencies.size) if index not in found]
        resume = saved[0] if saved else None
        try:
            asked = model, friction, amplitude, frequencies[left], way, AUTOMATIC
            for place, start in follow_branch(*asked, keep=keep, resume=resume):
                found[left[place]] = start
        except KilledError:
            continue
        return found, n_runs
    raise AssertionError("the runs never end")


INTERRUPTED = {
    "nodes and resolutions": (lambda: dovetail(13), 0.5, 0.5, [212.0, 212.6], "up"),
    "folds and settling in time": (lambda: scene("vibro_impact"), 0.0, 0.02, [0.2, 0.255], "up"),
    "masses on sliders": (lambda: scene("two_masses"), 0.5, 20.0, [0.1], "down"),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", INTERRUPTED)
def test_runs_that_end_at_each_save_arrive_at_the_same_numbers(case, monkeypatch):
    monkeypatch.setattr(sweep_module, "ITERATIONS_PER_SAVE", 5)
    build, friction, amplitude, frequencies, way = INTERRUPTED[case]
    model, at = build(), np.array(frequencies)
    whole = dict(follow_branch(model, friction, amplitude, at, way, AUTOMATIC))
    assert max(start.branch for start in whole.values()) == (1 if "folds" in case else 0)
    found, n_runs = in_short_runs(model, friction, amplitude, at, way)
    assert n_runs > 2 * len(whole)
    for index, wanted in whole.items():
        assert_same_state(found[index], wanted)
        assert found[index].newton_iterations == wanted.newton_iterations


@pytest.mark.slow
def test_the_iterations_of_a_frequency_are_its_own_whatever_is_known():
    together = starts([205.0, 211.0, 212.0])
    assert starts([212.0])[212.0].newton_iterations == together[212.0].newton_iterations
    assert together[205.0].newton_iterations < together[211.0].newton_iterations
