"""The progress of a history and of a sweep survives being kept, and what goes on from there ends with equal numbers."""

import math
from dataclasses import fields

import numpy as np
import pytest

from solver.outcome import Outcome
from solver.packing import Packed, pack, unpack
from solver.settings import Resolution, SolverSettings
from solver.wear import integrate
from tests.solver.models import branch_states, dovetail, march_wear
from tests.solver.test_branch_loss import start as impacting_start
from tests.solver.test_branch_loss import worn_wall

AUTO = SolverSettings(rtol=3e-2)
MOST_STOPS = 2


VALUES = (None, True, 3, -0.0, math.inf, "text", np.float64(0.1), Outcome.ADRIFT, Resolution((1, 3), 64))


@pytest.mark.parametrize("value", [*VALUES, (1, (2.5, [None, "a"])), {"a": {"b": 1}}])
def test_plain_values_come_back(value):
    found = unpack(pack(value))
    assert found == value
    assert type(found) is type(value)


def test_arrays_come_back_in_rows_and_as_copies():
    array = np.asfortranarray(np.random.default_rng(0).normal(size=(3, 4)))
    given = (array, array[:, ::2], np.array([True]), np.array([1j]))
    packed = pack(given)
    found = unpack(packed)
    for one, other in zip(found, given, strict=True):
        np.testing.assert_array_equal(one, other, strict=True)
        assert one.flags.c_contiguous
    array[:] = 0.0
    found[0][:] = 1.0
    assert (unpack(packed)[0] != 0.0).all()
    assert (unpack(packed)[0] != 1.0).any()


@pytest.mark.parametrize("value", [object(), {1, 2}, np.random.default_rng(0), AUTO])
def test_what_nobody_knows_is_refused(value):
    with pytest.raises(TypeError, match="packed"):
        pack(value)


@pytest.mark.parametrize("text", ["{", '["what", 1]', '["Path", {}]', '["array", 3]'])
def test_other_texts_are_refused(text):
    with pytest.raises((ValueError, KeyError, IndexError)):
        unpack(Packed(text, ()))


def assert_same(found, expected):
    """Equal to the last bit, but for the time that it took."""
    for entry in fields(expected):
        if entry.name != "run_time":
            np.testing.assert_array_equal(getattr(found, entry.name), getattr(expected, entry.name), err_msg=entry.name)


def from_every_stop(model, friction, start, wear, step, scheme, end, settings):
    """History, and the progress that was kept: from some of them it has to end the same way."""
    cycles = np.linspace(0.0, end, 5)
    kept: list[Packed] = []
    whole = march_wear(model, friction, start, wear, step, scheme, cycles, settings, keep=kept.append)
    places = [unpack(progress) for progress in kept]
    # within the history itself, one that it is compared with, and the reference solution: from the last one backwards
    stages = {len(at.done): [n for n, other in enumerate(places) if len(other.done) == len(at.done)] for at in places}
    for found in stages.values():
        for n in found[:: -max(1, len(found) // MOST_STOPS)][:MOST_STOPS]:
            again = march_wear(model, friction, start, wear, step, scheme, cycles, settings, resume=kept[n])
            assert_same(again, whole)
    own = [at.state.cycle for at in places if not at.done]
    return whole, own, len(stages)


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "step"), [("implicit", 800.0), ("adaptive", 1.0)])
def test_a_history_goes_on_to_the_same_numbers(scheme, step, monkeypatch):
    monkeypatch.setattr(integrate, "ITERATIONS_PER_SAVE", 8)
    (start,) = branch_states(dovetail(7), 0.5, 0.5, [2 * np.pi * 213.0], AUTO)
    whole, own, n_stages = from_every_stop(dovetail(7), 0.5, start, 1.1e-11, step, scheme, 8e3, AUTO)
    assert whole.outcome is Outcome.CONVERGED
    assert whole.worn_volume[-1] > 0.0
    assert len(own) >= 3
    assert n_stages == (2 if scheme == "adaptive" else 3)


@pytest.mark.slow
def test_a_history_goes_on_before_and_behind_a_jump(monkeypatch):
    monkeypatch.setattr(integrate, "ITERATIONS_PER_SAVE", 30)
    settings = SolverSettings(11, 128)
    whole, own, _ = from_every_stop(worn_wall(1.0), 1e-3, impacting_start(), 1e-7, 100.0, "implicit", 1000.0, settings)
    assert min(own) < whole.jump_cycle < max(own)
