"""Harmonics and samples of the nodes of a sweep: check whether they still suffice, and new choice."""

from __future__ import annotations

from dataclasses import replace

from solver.accuracy.harmonic_levels import shifted
from solver.accuracy.options import ACCURACY
from solver.accuracy.period_events import nothing_happens
from solver.accuracy.refinement import Refined, refine
from solver.accuracy.resolved_state import ResolvedState
from solver.harmonic_balance.prolongation import transfer
from solver.harmonic_balance.state import State
from solver.newton.run import Run
from solver.settings import FINE_SAMPLES, Resolution, allowed, first_resolution
from solver.structure.joint import Case, Joint


def resolution_holds(case: Case, joint: Joint, point: State, at_limit: bool, run: Run) -> bool:
    """Whether a state has about the harmonics and samples that it needs, by one linear solve at most.

    One Newton iteration two levels of harmonics up, with twice the samples, shows the error.
    False where this error is above rtol, or so far below that fewer harmonics may suffice.
    at_limit: whether more harmonics are not allowed.
    """
    resolution, evaluation = case.resolution, point.evaluation
    fewest = resolution == first_resolution(case.settings)
    if nothing_happens(evaluation):
        looked = Resolution(resolution.orders, max(FINE_SAMPLES, 2 * resolution.samples))
        # an event that only more samples show is left to `refine`
        return fewest and nothing_happens(_moved(case, joint, point, looked, run, 0).point.evaluation)
    above = shifted(resolution, 2)
    above = allowed(Resolution(above.orders, 2 * above.samples), case.settings)
    if not case.model.holds(above.highest):
        return False
    better = _moved(case, joint, point, above, run, 1)
    error = ResolvedState(case, joint, point).difference(better).times(ACCURACY.two_levels_safety).largest
    settings = case.settings
    least = 0.0 if fewest else ACCURACY.kept_fraction**2 * settings.rtol
    return bool(error >= least and (at_limit or error <= settings.rtol))


def _moved(case: Case, joint: Joint, point: State, resolution: Resolution, run: Run, iterations: int) -> ResolvedState:
    """A state with other harmonics and samples, improved by a number of Newton iterations."""
    other = case.at(resolution)
    other_joint = other.joint(joint.omega, joint.excitation_amplitude)
    balance, start = transfer(case, other_joint, point.evaluation)
    at = balance.evaluate(start)
    for _ in range(iterations):
        step = run.fresh().step(balance, at, -at.residual)
        at = balance.evaluate(at.predicted_h + step)
        run.budget.iterations += 1
    return ResolvedState(other, other_joint, replace(point, evaluation=at))


def choose_resolution(case: Case, joint: Joint, point: State, run: Run) -> Refined:
    """A node with the harmonics and samples that it needs, at least the first ones of automatic settings."""
    # `node_unknowns` limits the harmonics: their error shows in the difference to the reference sweep
    refined = refine(case, joint.omega, joint.excitation_amplitude, point, run, ACCURACY.node_unknowns)
    fewest = first_resolution(case.settings)
    if refined.case.resolution.highest >= fewest.highest:
        return refined
    # a joint that sticks needs one harmonic only, but may slip at the next node
    if case.resolution == fewest:
        return replace(refined, case=case, point=point)
    moved = case.at(fewest)
    moved_joint = moved.joint(joint.omega, joint.excitation_amplitude)
    level = run.move(refined.case, moved_joint, refined.point)
    return refined if level is None else replace(refined, case=moved, point=level)
