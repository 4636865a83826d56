"""What is kept of the steps of a wear history, and what is read between their ends."""

import numpy as np
import pytest

from solver.settings import WearTarget
from solver.wear import course as course_module
from solver.wear.course import CERTIFIED, Course, Node

AREA = np.array([1.0, 3.0])
LOOP = np.ones((1, 128, 3))
INTERPOLATED = ("mean_pressure", "response", "response_peak", "loop_force", "excitation_frequency")
RESOLUTIONS = ((3, 64), (5, 128))


def node(count, depth, rate, value, resolution=RESOLUTIONS[0], **more):
    """All numbers of a state but its depths are `value`."""
    numbers = dict.fromkeys(("mean_pressure", "slip_range", "open_fraction"), np.full(2, value))
    numbers |= dict.fromkeys(("excitation_frequency", "excitation_frequency_error"), value)
    numbers |= dict.fromkeys(("loop_displacement", "loop_force"), value * LOOP)
    numbers |= {
        "response": np.full(1, value * 1j),
        **dict.fromkeys(("response_mean", "response_peak"), np.full(1, value)),
    }
    numbers |= dict.fromkeys(CERTIFIED, value) | dict(zip(("harmonics_used", "samples_used"), resolution, strict=True))
    return Node(count, np.array(depth, float), np.array(rate, float), numbers | more)


def taken(counts, n_steps=3, **more):
    """Steps of 10 cycles; the first pair wears as t^2, the second one nothing."""
    course = Course(AREA, np.array(counts or (), float), **more)
    for n in range(n_steps + 1):
        at = 10.0 * n
        end = node(at, [at**2, 0.0], [2.0 * at, 0.0], float(n), RESOLUTIONS[n // 2 % 2], local=0.5 * (n + 1))
        course = course.after(end)
    return course


def test_what_holds_at_both_ends_of_a_step_holds_between():
    found = taken([0.0, 4.0, 10.0, 25.0]).read(np.array([0.0, 4.0, 10.0, 25.0]))
    for name in CERTIFIED:
        assert found[name].tolist() == [0.0, 1.0, 1.0, 3.0], name
    # and what has no value between those of both ends is that of the later one
    assert found["harmonics_used"].tolist() == [3, 3, 3, 5]
    assert found["samples_used"].tolist() == [64, 64, 64, 128]
    # local errors add up from step to step, and with the wear of a step
    assert found["local"] == pytest.approx([0.5, 0.58, 1.0, 1.725])


def test_within_a_step_the_depth_is_a_cubic_and_all_else_linear_in_the_volume():
    found = taken([5.0, 14.0]).read(np.array([5.0, 14.0]))
    # t^2 is a cubic
    assert found["wear_depth"] == pytest.approx(np.array([[25.0, 0.0], [196.0, 0.0]]))
    shares = np.array([0.25, 1.0 + 96.0 / 300.0])
    assert found["wear_rate"] == pytest.approx(20.0 * shares)
    for name in INTERPOLATED:
        values = np.abs(found[name].reshape(2, -1))
        assert values == pytest.approx(np.repeat(shares[:, None], values.shape[1], axis=1)), name


def test_a_cubic_never_falls_however_steep_its_ends_are():
    course = Course(AREA).after(node(0.0, [0.0, 0.0], [100.0, 0.0], 0.0))
    course = course.after(node(10.0, [1.0, 1.0], [0.0, 100.0], 1.0))
    depth = course.read(np.linspace(0.0, 10.0, 101))["wear_depth"]
    assert (np.diff(depth, axis=0) >= 0.0).all()
    assert depth[-1].tolist() == [1.0, 1.0]


@pytest.mark.parametrize("quantity", ["wear_depth", "worn_volume"])
def test_a_target_is_found_within_the_step_that_reaches_it(quantity):
    # later steps do not move it
    for n_steps in (3, 6):
        course = taken(None, n_steps, target=WearTarget(quantity, 500.0))
        assert course.reached == pytest.approx(np.sqrt(500.0), rel=1e-9)
    assert np.isnan(taken(None, target=WearTarget(quantity, 1e4)).reached)


def shifting(resonances, wanted):
    """A course of steps of 10 cycles, in each of which every pair wears by 1."""
    course = Course(AREA, target=WearTarget("frequency_shift", wanted))
    for n, resonance in enumerate(resonances):
        course = course.after(node(10.0 * n, [n, n], [0.1, 0.1], 0.0, resonance=resonance, resonance_error=0.0))
    return course


def test_a_shift_of_the_resonance_is_found_as_a_function_of_the_worn_volume():
    # by 1 % up, then by 3 % down
    course = shifting((100.0, 101.0, 97.0), 0.02)
    assert course.reach(course.target) == (pytest.approx(17.5), 0.0)
    # a parabola through the end before and both ends of the step
    ends = np.array([0.0, 10.0, 20.0, 30.0])
    shifts = 0.1 * (ends / 30.0) ** 0.5
    course = shifting(100.0 * (1.0 + shifts), 0.06)
    assert course.reached == pytest.approx(np.polyval(np.polyfit(shifts[:3], ends[:3], 2), 0.06))
    assert course.reach(course.target)[1] == pytest.approx(np.interp(0.06, shifts, ends) - course.reached)


def test_even_counts_are_as_far_from_each_other_in_volume_and_cycles_together():
    course = taken(None)
    counts = course.even_counts(7)
    assert counts[0] == 0.0
    assert counts[-1] == 30.0
    volumes = course.read(counts)["wear_depth"] @ AREA
    assert np.diff(counts / 30.0 + volumes / volumes[-1]) == pytest.approx(np.full(6, 2.0 / 6.0), rel=1e-9)
    to_target = taken(None, target=WearTarget("wear_depth", 500.0))
    assert to_target.even_counts(3)[-1] == to_target.reached < 30.0
    assert taken(None, n_steps=0).even_counts(3).tolist() == [0.0, 0.0, 0.0]


def test_of_many_steps_those_that_go_far_and_those_that_are_read_are_kept(monkeypatch):
    asked = [5.0, 15.0, 1005.0]
    whole = taken(None, n_steps=200)
    monkeypatch.setattr(course_module, "KEPT_STEPS", 20)
    course = taken(asked, n_steps=200)
    assert len(course.nodes) <= 26
    assert course.counts[[0, -1]].tolist() == [0.0, 2000.0]
    assert course.ends == tuple(np.arange(201) * 10.0)
    counts = np.linspace(0.0, 2000.0, 11)
    one, other = (each.read(counts)["wear_depth"] for each in (course, whole))
    assert np.abs(one - other).max() < 0.02 * other.max()
    one, other = (each.read(np.array(asked)) for each in (course, whole))
    for name, values in one.items():
        assert np.array_equal(values, other[name]), name
