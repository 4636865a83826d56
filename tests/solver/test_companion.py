"""The error of a worn volume against what it is wrong by: exact wear of the slider, short steps of the dovetail."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from solver.results.recorder import _before
from solver.wear.companion import Companion
from solver.wear.trajectory import Trajectory

from solver.accuracy.error_estimate import NOTHING, UNKNOWN, Estimate
from solver.accuracy.refinement import Refined, refine
from solver.model import ReducedModel
from solver.outcome import Outcome
from solver.results import recorder
from solver.results.history import StartState, WearHistory
from solver.results.options import RESULTS
from solver.settings import Scheme, SolverSettings
from solver.wear import march as march_module
from solver.wear import trajectory
from tests.references import slider_amplitude, slider_wear_depth
from tests.solver.models import branch_states, dovetail, march_wear, scene

WEAR = 1.1e-11  # 1/Pa
GIVEN = SolverSettings(harmonics=5, samples=64)
CYCLES = np.linspace(0.0, 4e4, 9)
BESIDE = 213.0  # Hz: the coarse sector wears there, and stops
SCHEMES: list[tuple[Scheme, float]] = [
    ("implicit", 4000.0),
    ("implicit", 1000.0),
    ("explicit", 4000.0),
    ("explicit", 1000.0),
    ("adaptive", 1e-2),
]


@lru_cache
def start(frequency: float = BESIDE) -> tuple[ReducedModel, StartState]:
    model = dovetail(9)
    (found,) = branch_states(model, 0.5, 0.5, [2 * np.pi * frequency], GIVEN)
    return model, found


@lru_cache
def worn(scheme: Scheme, step: float, wear: float = WEAR, frequency: float = BESIDE) -> WearHistory:
    """step: cycles, or rtol of the adaptive scheme."""
    model, found = start(frequency)
    settings = SolverSettings(5, 64, rtol=step) if scheme == "adaptive" else GIVEN
    return march_wear(model, 0.5, found, wear, step, scheme, CYCLES, settings)


def errors(history: WearHistory, truth: WearHistory) -> np.ndarray:
    """Estimated over true errors of the volume at all counts but the first, m3."""
    true = np.abs(history.worn_volume - truth.worn_volume)[1:]
    return (history.worn_volume_error * history.worn_volume)[1:] / true


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "step"), SCHEMES)
def test_the_error_of_the_dovetail_holds_that_of_its_steps(scheme: Scheme, step: float) -> None:
    truth = worn("implicit", 50.0)
    history = worn(scheme, step)
    assert history.outcome is Outcome.CONVERGED
    ratio = errors(history, truth)
    assert ratio.min() > 0.5
    assert history.error_estimate < 0.5
    # of the pairs, together: what one is wrong by may cross zero
    of_pairs = np.abs(history.wear_depth - truth.wear_depth)[-1]
    assert history.wear_depth_error[-1].sum() > 0.5 * of_pairs.sum()


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["implicit", "explicit"])
def test_the_error_falls_with_the_step(scheme: Scheme) -> None:
    steps = np.array([4000.0, 2000.0, 1000.0])
    model = scene("sdof_slider", 9)
    settings = SolverSettings(9, 256)
    (found,) = branch_states(model, 0.5, 10.0, [2 * np.pi * 160.0], settings)
    sizes = [march_wear(model, 0.5, found, WEAR, step, scheme, CYCLES, settings).error_estimate for step in steps]
    # what harmonics and samples leave wrong stays
    assert sizes[0] > sizes[1] > sizes[2]


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "step"), SCHEMES)
def test_the_error_of_the_slider_holds_the_exact_answer(scheme: Scheme, step: float) -> None:
    model = scene("sdof_slider", 21)
    settings = SolverSettings(21, 256, rtol=step) if scheme == "adaptive" else SolverSettings(21, 256)
    (found,) = branch_states(model, 0.5, 10.0, [2 * np.pi * 160.0], settings)
    cycles = np.linspace(0.0, 8e4, 5)
    history = march_wear(model, 0.5, found, WEAR, step, scheme, cycles, settings)
    assert history.outcome is Outcome.CONVERGED
    exact = slider_wear_depth(
        cycles,
        wear_coefficient=WEAR,
        area=1e-4,
        friction_coefficient=0.5,
        normal_load=10.0,
        normal_stiffness=1e5,
        amplitude=lambda friction_force: slider_amplitude(0.1, 0.0, 1.6e5, 10.0, friction_force, 2 * np.pi * 160.0),
    )
    true = np.abs(history.wear_depth[:, 0] - exact)[1:]
    assert (history.wear_depth_error[1:, 0] > 0.5 * true).all()
    assert history.error_estimate < 0.3


@pytest.mark.slow
def test_nothing_that_wears_nothing_has_an_error() -> None:
    history = worn("implicit", 1000.0, frequency=205.0)
    assert history.outcome is Outcome.CONVERGED
    assert not history.worn_volume.any()
    assert not history.worn_volume_error.any()
    assert history.error_estimate == 0.0


@pytest.mark.slow
def test_what_was_computed_of_a_history_that_ends_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = worn("implicit", 1000.0)
    check = Trajectory.check

    def give_up(self: Trajectory) -> Outcome:
        return check(self) if self.cycle <= 12_000.0 else Outcome.CERTIFICATE_FAILED

    monkeypatch.setattr(Trajectory, "check", give_up)
    model, found = start()
    ended = march_wear(model, 0.5, found, WEAR, 1000.0, "implicit", CYCLES, GIVEN)
    assert ended.outcome is Outcome.CERTIFICATE_FAILED
    assert ended.last_cycle == 12_000.0
    known = CYCLES <= 12_000.0
    assert np.array_equal(ended.worn_volume[known], whole.worn_volume[known])
    assert np.isnan(ended.worn_volume[~known]).all()
    assert np.isnan(ended.worn_volume_error[~known]).all()
    assert (ended.harmonics_used[~known] == 0).all()
    assert ended.error_estimate == ended.worn_volume_error[known][-1] > 0.0


@pytest.mark.slow
def test_a_volume_that_one_number_does_not_tell_is_said_to_be_sensitive(monkeypatch: pytest.MonkeyPatch) -> None:
    usual = worn("explicit", 4000.0)
    monkeypatch.setattr(march_module, "SENSITIVE_ERROR", 0.9 * usual.error_estimate)
    model, found = start()
    history = march_wear(model, 0.5, found, WEAR, 4000.0, "explicit", CYCLES, GIVEN)
    assert history.outcome is Outcome.SENSITIVE
    # both values, in words
    assert f"worn volume {1e9 * history.worn_volume[-1]:.3g} mm3, but " in history.message
    assert np.array_equal(history.worn_volume, usual.worn_volume)


def test_histories_that_cross_are_wrong_by_what_they_differed_before() -> None:
    cycles = np.linspace(0.0, 10.0, 11)
    met = [(float(at), abs(float(at) - 6.0)) for at in np.arange(0.5, 8.0, 0.5)]
    error = _before(cycles, met)
    assert error[0] == 0.0
    assert error[6] == 3.0
    assert error[10] == 1.5
    # what comes later changes nothing
    assert np.array_equal(_before(cycles[:6], met[:10]), error[:6])
    assert (_before(cycles, []) == 0.0).all()


@pytest.mark.slow
def test_an_error_of_the_start_state_is_taken_to_grow(monkeypatch: pytest.MonkeyPatch) -> None:
    """The volume is not known better than a multiple of what the wear rates of the start states differ by."""
    model, found = start()
    at_ends = []
    for safety in (0.0, 1e4, 2e4):
        monkeypatch.setattr(recorder, "RESULTS", replace(RESULTS, start_safety=safety))
        history = march_wear(model, 0.5, found, WEAR, 1e3, "adaptive", CYCLES, SolverSettings(5, 64))
        at_ends.append(history.error_estimate)
    none, once, twice = at_ends
    assert none < 0.05
    assert once > 2.0 * none
    assert twice == pytest.approx(2.0 * once, rel=0.05)
    assert RESULTS.start_safety >= 3.0


@pytest.mark.slow
def test_errors_are_estimated_again_where_the_joint_wears_at_another_rate(monkeypatch: pytest.MonkeyPatch) -> None:
    found = {}
    for change in (0.1, 10.0):
        estimated: list[float] = []

        def note(*given: Any, estimated: list[float] = estimated, **named: Any) -> Refined:
            estimated.append(float(given[3].evaluation.slip_work.sum()))
            return refine(*given, **named)

        monkeypatch.setattr(trajectory, "WEAR", replace(trajectory.WEAR, rate_recheck=change))
        monkeypatch.setattr(trajectory, "refine", note)
        model, state = start()
        march_wear(model, 0.5, state, WEAR, 1000.0, "implicit", CYCLES, GIVEN)
        found[change] = estimated
    assert len(found[0.1]) > len(found[10.0])
    # from one to the next by little more than a tenth, as far as a single step goes, while much is worn
    rates = np.array(found[0.1])
    rates = rates[rates > 0.3 * rates.max()]
    assert (np.abs(np.diff(rates)) < 0.3 * np.maximum(rates[1:], rates[:-1])).all()


@pytest.mark.slow
@pytest.mark.parametrize(("detours", "found_again"), [(1, True), (100, False)])
def test_a_companion_that_was_lost_once_is_followed_again(
    detours: int, found_again: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    usual = worn("implicit", 1000.0)
    step, left = Companion._step, [detours]

    def go_astray(self: Companion) -> bool:
        if left[0] > 0 and self.trajectory.cycle > 0.0:
            left[0] -= 1
            self.effort.iterations += 1000
        return step(self)

    monkeypatch.setattr(Companion, "_step", go_astray)
    model, found = start()
    history = march_wear(model, 0.5, found, WEAR, 1000.0, "implicit", CYCLES, GIVEN)
    assert np.array_equal(history.worn_volume, usual.worn_volume)
    # what was worn while it was lost is not confirmed; once it is given up, nothing that comes after
    assert usual.error_estimate < history.error_estimate
    assert (history.error_estimate < 0.4) == found_again
    assert (history.error_estimate > 0.8) == (not found_again)


@pytest.mark.parametrize(
    ("other", "error", "said"),
    [
        (0.5, 0.6, "worn volume 1 mm3, but 0.5 mm3 with steps twice as long from the start state of a coarser sweep: "),
        (0.9, 3.0, "worn volume 1 mm3, not known: 0.9 mm3 with steps twice as long from the start state of a coarser "),
        (np.nan, 0.6, "worn volume 1 mm3, known to 60 % only: steps twice as long from the start state of a coarser "),
    ],
)
def test_a_sensitive_volume_is_told_with_what_differs(other: float, error: float, said: str) -> None:
    area = np.array([2.0])
    march: Any = SimpleNamespace(joint=SimpleNamespace(contact=SimpleNamespace(area=area)), worst=NOTHING)
    history: Any = SimpleNamespace(error_estimate=error, wear_depth=np.array([[0.0], [0.5e-9]]))
    outcome, message = march_module._judge(march, history, np.array([[0.0], [0.5e-9 * other]]))
    assert outcome is Outcome.SENSITIVE
    assert message.startswith(said)


def test_a_wear_rate_that_more_harmonics_change_is_told_as_the_cause() -> None:
    """Steps and start state agree: it is not they that leave the volume unknown."""
    area, worst = np.array([2.0]), Estimate(1e-4, 5.2, 0.02)
    march: Any = SimpleNamespace(joint=SimpleNamespace(contact=SimpleNamespace(area=area)), worst=worst)
    history: Any = SimpleNamespace(error_estimate=6.9, wear_depth=np.array([[0.0], [0.5e-9]]))
    outcome, message = march_module._judge(march, history, np.array([[0.0], [0.5e-9]]))
    assert outcome is Outcome.INACCURATE
    assert message.startswith(
        "worn volume 1 mm3, not known: more harmonics and samples change the wear rate by 5.2e+02 %"
    )


@pytest.mark.slow
@pytest.mark.parametrize("error", [np.inf, np.nan])
def test_a_state_whose_wear_rate_is_not_known_counts_for_its_own_stretch(
    monkeypatch: pytest.MonkeyPatch, error: float
) -> None:
    usual, report = worn("implicit", 1000.0), Trajectory.report

    def not_known(self: Trajectory) -> Any:
        known = report(self)
        unknown = replace(known.certificate, wear_rate_error=error)
        return replace(known, certificate=unknown) if self.cycle == 1000.0 else known

    monkeypatch.setattr(Trajectory, "report", not_known)
    model, found = start()
    history = march_wear(model, 0.5, found, WEAR, 1000.0, "implicit", CYCLES, GIVEN)
    assert usual.error_estimate < history.error_estimate < 10.0
    assert np.isfinite(history.worn_volume_error).all()


def test_a_volume_whose_error_nothing_tells_says_that() -> None:
    fixed = SimpleNamespace(settings=SolverSettings(harmonics=1, samples=32))
    march: Any = SimpleNamespace(case=fixed, worst=UNKNOWN, inaccurate_from=0.0)
    history: Any = SimpleNamespace(error_estimate=10.0)
    outcome, message = march_module._judge(march, history, np.zeros((2, 1)))
    assert outcome is Outcome.INACCURATE
    assert message.startswith("from cycle 0 on the error of the wear rate is not known: no state with more harmonics")
