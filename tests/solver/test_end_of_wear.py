"""Histories that end at a wear, or where nothing wears any more; joints that wear without end."""

from functools import lru_cache

import numpy as np
import pytest

from solver import march_wear as march_model
from solver.harmonic_balance.state import Failure
from solver.outcome import Outcome
from solver.packing import Packed
from solver.settings import SolverSettings, ToTheEnd, WearTarget
from solver.wear.problem import WearProblem
from studies import build_scene
from tests.solver.models import assert_same, march_wear, sweep_of
from tests.solver.worn_slider import AREA, CYCLES, END, WEAR, march
from tests.studies.half_space_twin import limit_depth


@pytest.mark.parametrize("scheme", ["explicit", "implicit", "adaptive"])
def test_the_count_is_that_at_which_the_history_has_the_wear(scheme):
    depth = 2.3e-5
    target = WearTarget("worn_volume", depth * AREA) if scheme == "explicit" else WearTarget("wear_depth", depth)
    found = march(4000.0, scheme, until=target)
    assert found.outcome is Outcome.CONVERGED
    # the same history, read at that very count
    read = march(4000.0, scheme, np.array([0.0, found.cycles_to_target, END]))
    assert read.wear_depth[1, 0] == pytest.approx(depth, rel=1e-9)
    # it ends there, and what there is of it is that of the whole one
    whole = march(4000.0, scheme)
    reached = np.isfinite(found.worn_volume)
    assert 0 < reached.sum() < CYCLES.size
    assert reached[found.cycles_to_target >= CYCLES].all()
    assert found.last_cycle >= found.cycles_to_target
    assert np.array_equal(found.wear_depth[reached], whole.wear_depth[reached])
    assert found.newton_iterations < whole.newton_iterations


@pytest.mark.parametrize(
    ("scheme", "target"),
    [("adaptive", WearTarget("wear_depth", 2.3e-5)), ("implicit", WearTarget("frequency_shift", 1e-4))],
)
def test_the_error_of_a_life_is_not_known_where_the_other_solution_has_no_state(scheme, target, monkeypatch):
    own = WearProblem.advance

    def advance(self, state, course):
        other = self.guide is not None or (self.request.steps is None and scheme == "implicit")
        return Failure(Outcome.MARCH_FAILED, "lost") if other else own(self, state, course)

    monkeypatch.setattr(WearProblem, "advance", advance)
    found = march(4000.0, scheme, until=target)
    assert found.cycles_to_target > 0.0
    assert found.cycles_to_target_error == np.inf


# by frequency, Hz: a depth, m, the cycles until it is worn, and the relative change of w_r until then, by Den Hartog's
# form: w_r^2 = w^2 + Re(x^H F) / (m |x|^2), from the first harmonics of motion and force
EXACT = {
    190.0: (1.5e-5, 7865.451308763169, 4.2380901812966165e-4),
    160.0: (3e-5, 53747.8054810932, 9.630337525180499e-3),
}


def target_of(quantity, frequency):
    depth, _, shift = EXACT[frequency]
    return WearTarget(quantity, {"wear_depth": depth, "worn_volume": depth * AREA, "frequency_shift": shift}[quantity])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("quantity", "frequency"), [("wear_depth", 190.0), ("worn_volume", 160.0), ("frequency_shift", 190.0)]
)
def test_the_error_of_a_life_is_at_least_the_true_one_whatever_is_read(frequency, quantity):
    model, (_, exact, _), target = build_scene("sdof_slider"), EXACT[frequency], target_of(quantity, frequency)
    found = [march_model(model, frequency, 10.0, 0.5, WEAR, np.linspace(0.0, 4e5, n), until=target) for n in (2, 101)]
    for each in found:
        assert abs(each.cycles_to_target - exact) <= each.cycles_to_target_error < np.inf
        assert each.cycles_to_target == found[0].cycles_to_target
        assert each.cycles_to_target_error == pytest.approx(found[0].cycles_to_target_error, rel=1e-9)
    # all that is held of the first one is the unworn joint, which tells nothing of what has worn
    assert np.isnan(found[0].error_estimate)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scheme", "quantity", "most"),
    [
        ("explicit", "frequency_shift", np.inf),
        ("implicit", "wear_depth", np.inf),
        ("adaptive", "frequency_shift", 2e-2),
    ],
)
def test_the_error_of_a_life_holds_that_of_the_steps(scheme, quantity, most):
    """With a smaller rtol a life is known better."""
    asked = {"cycles": np.linspace(0.0, 4e5, 11), "scheme": scheme, "step": 4000.0, "until": target_of(quantity, 160.0)}
    asked |= {"settings": SolverSettings(harmonics=19, samples=256, rtol=1e-3)} if scheme == "adaptive" else {}
    found = march_model(build_scene("sdof_slider"), 160.0, 10.0, 0.5, WEAR, **asked)
    assert abs(found.cycles_to_target - EXACT[160.0][1]) <= found.cycles_to_target_error
    assert found.cycles_to_target_error < most * found.cycles_to_target


# --- until nothing wears any more ---

COARSE = SolverSettings(harmonics=3, samples=64)


@lru_cache
def unworn():
    """A cylinder in partial slip."""
    model = build_scene("cylinder_on_flat", strips=12)
    ((_, start),) = sweep_of(model, 0.6, 1.0, "ramp", COARSE).states(np.array([20.0]))
    return model, start


def worn(cycles, scheme="adaptive", **more):
    model, start = unworn()
    return march_wear(model, 0.6, start, 1e-13, 1000.0, scheme, cycles, COARSE, **more)


@pytest.mark.parametrize("scheme", ["adaptive", "implicit"])
def test_partial_slip_ends_in_the_limit_state_of_the_strips_also_where_it_was_interrupted(scheme, monkeypatch):
    monkeypatch.setattr(WearProblem, "iterations_per_save", 30)
    kept = list[Packed]()
    found = worn(ToTheEnd(9), scheme, keep=kept.append)
    assert_same(worn(ToTheEnd(9), scheme, resume=kept[-1]), found)
    # the harmonics are given
    assert found.outcome is (Outcome.CONVERGED if scheme == "implicit" else Outcome.INACCURATE)
    # which pairs slip decides the final depths; those between which pressure moves are at least 2e-4 exact
    limit = limit_depth(unworn()[0], found.slip_range[-1] == 0.0)
    assert limit.max() > 0.0
    assert np.abs(found.wear_depth[-1] - limit).max() < 2e-4 * limit.max()
    assert found.wear_rate[-1] < 1e-4 * found.wear_rate.max()
    assert found.last_cycle == found.cycles[-1]
    # as far from one output to the next in volume and cycles together, each over the whole
    way = found.worn_volume / found.worn_volume[-1] + found.cycles / found.cycles[-1]
    assert np.diff(way) == pytest.approx(np.full(8, 0.25), rel=1e-6)
    assert found.cycles[0] == 0.0
    assert (np.diff(found.cycles) > 0.0).all()


def test_a_constant_load_wears_without_end_at_the_rate_of_its_path():
    model = build_scene("sdof_slider", normal_stiffness=0.0)
    found = march_model(model, 160.0, 10.0, 0.5, WEAR, np.inf, settings=COARSE, outputs=4)
    assert found.outcome is Outcome.NO_FINAL_STATE
    assert not found.outcome.complete
    path = 2.0 * found.slip_range[-1, 0]
    assert found.wear_rate[-1] == pytest.approx(WEAR * 10.0 * path, rel=1e-2)
    assert np.isfinite(found.worn_volume).all()
