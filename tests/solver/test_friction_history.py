"""Slow time of adaptive histories against exact ones and against many short steps."""

import numpy as np
import pytest

from solver.histories import march_wear
from solver.outcome import Outcome
from solver.results.history import StartState
from solver.settings import SolverSettings
from solver.structure.joint import build_case
from solver.wear import step
from solver.wear.integrate import Integrations, SlowTime
from solver.wear.step import Adaptive
from tests.solver.models import branch_states, scene
from tests.solver.worn_slider import WEAR, exact_depths_of_motion


def steps_and_volume(scene_name: str, start: StartState, settings: SolverSettings, cycles: float) -> tuple[int, float]:
    """Number of steps and worn volume, m3, of an adaptive history without its reference solution."""
    model = scene(scene_name, 13, **({"mesh": 1} if scene_name == "dovetail_sector" else {}))
    case = build_case(model, 0.5, start.penalty_omega, settings, start.resolution)
    ended = Integrations(case, start).history(SlowTime(WEAR, Adaptive(settings.rtol), np.array([0.0, cycles])))
    depth = ended.course.read(np.array([cycles]))["wear_depth"]
    return len(ended.course.ends), float((depth @ model.contact.area)[0])


def dovetail_start(frequency: float) -> StartState:
    """Start state of the dovetail with 16 pairs at a frequency, Hz."""
    model, omega = scene("dovetail_sector", 13, mesh=1), 2.0 * np.pi * frequency
    (start,) = branch_states(model, 0.5, 0.5, [omega], SolverSettings(9, 128))
    return start


@pytest.mark.slow
def test_sticking_pairs_slide_along_the_way_of_a_step(monkeypatch):
    """Pairs that stick slide slowly while others wear: with one slide for each step the volume is too small."""
    start = dovetail_start(212.6)

    def volume(rtol: float) -> float:
        return steps_and_volume("dovetail_sector", start, SolverSettings(9, 128, rtol=rtol), 3e4)[1]

    fine = volume(1e-3)
    assert volume(1e-2) == pytest.approx(fine, rel=3e-3)
    monkeypatch.setattr(step, "history_along", lambda _, state, __: state.point.history)
    assert volume(1e-2) < 0.99 * fine


@pytest.mark.slow
def test_a_pair_that_only_just_slips_goes_on_as_in_a_time_integration_of_every_cycle(monkeypatch):
    """With one slide for each step this pair sticks again."""
    start, settings = dovetail_start(212.5), SolverSettings(9, 128)
    volume = steps_and_volume("dovetail_sector", start, settings, 1e5)[1]
    assert volume == pytest.approx(2.026e-9, rel=4e-3)
    monkeypatch.setattr(step, "history_along", lambda _, state, __: state.point.history)
    assert steps_and_volume("dovetail_sector", start, settings, 1e5)[1] < 0.95 * volume


@pytest.mark.slow
@pytest.mark.parametrize(("mesh", "frequency", "volume"), [(1, 212.6, 1.810), (2, 211.5, 2.261)])
def test_where_pairs_slide_or_stick_again_the_history_is_that_of_a_time_integration(mesh, frequency, volume):
    """At 211.5 Hz the history of the whole way to the extrapolated end leads to another branch, 1.667 mm3."""
    counts = np.array([0.0, 1e5])
    history = march_wear(scene("dovetail_sector", mesh=mesh), frequency, 0.5, 0.5, WEAR, counts)
    apart = abs(1e9 * history.worn_volume[-1] / volume - 1.0)
    assert apart < history.error_estimate < 0.03


@pytest.mark.slow
def test_the_slow_time_of_the_slider_is_of_second_order():
    model, settings = scene("sdof_slider", 13), SolverSettings(13, 128)
    (start,) = branch_states(model, 0.5, 10.0, [2.0 * np.pi * 160.0], settings)
    given = [SolverSettings(13, 128, rtol=rtol) for rtol in (1e-2, 1e-3, 1e-6)]
    (few, coarse), (many, fine), (_, finest) = (steps_and_volume("sdof_slider", start, one, 1e5) for one in given)
    order = np.log(abs(coarse - finest) / abs(fine - finest)) / np.log(many / few)
    assert order > 1.7


@pytest.mark.parametrize(
    ("wear", "cycles", "outputs", "rtol"), [(1e-13, 1e3, 2, 0.1), (WEAR, 5e3, 101, 1e-2), (WEAR, 1e5, 11, 5e-2)]
)
def test_the_error_of_a_history_covers_and_does_not_alarm(wear, cycles, outputs, rtol):
    """Also for a count at the beginning of a long step, and where start state and steps have similar errors."""
    counts = np.linspace(0.0, cycles, outputs)
    history = march_wear(scene("sdof_slider", 21), 160.0, 10.0, 0.5, wear, counts, settings=SolverSettings(rtol=rtol))
    true = abs(float(history.wear_depth[-1, 0] / exact_depths_of_motion(np.array([0.0, cycles]), wear)[-1]) - 1.0)
    assert history.outcome is Outcome.CONVERGED
    assert true <= history.error_estimate <= 2.0 * rtol
