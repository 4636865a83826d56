"""A slow sweep: states with steps of their own, which leave the joint as the machine would.

Friction gives a joint a family of periodic states. The tangential displacements at which the pairs stick select one of
them, and these displacements depend on all vibration before. So a sweep has nodes of its own, whose distance depends
only on the change of the vibration from node to node. A state between two nodes is solved from the node before and
leaves the sweep unchanged. So the state of a point does not depend on the other points of the study.

The error of a sweep comes from its steps: a pair that sticks from some value on keeps the history of the last node with
slip, up to one step too early. A reference sweep has steps twice as long, and harmonics one level lower where these are
automatic. The difference of both sweeps is at least half the error of the finer one, and as a rule the error of the
coarser one. There is no difference, and no reference, as long as nothing slips or opens, and where each pair slips or
opens within the period: such a state follows from its parameter alone. Where the sweep jumps over a fold, its reference
begins anew behind the jump: the place of a jump is no measure of the error by steps.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Generic

import numpy as np

from solver.accuracy.harmonic_levels import fewer
from solver.accuracy.options import ACCURACY
from solver.harmonic_balance.state import Failure
from solver.loading_history.path_of_states import Path, S, Step
from solver.march.steps import Lengths, take_step
from solver.newton.run import Budget, Run
from solver.outcome import SENSITIVE_ERROR, Outcome
from solver.packing import in_rows, packable
from solver.settings import Resolution

AIMED_CHANGE = 0.75
"""Expected change of the vibration in the next step over the largest change. Few steps are refused."""

SWEEP_ITERATIONS = 8000
"""Most Newton iterations of a sweep: more in jumps and searches are in vain (the dovetail takes 300)."""

NODE_ITERATIONS = 5 * SWEEP_ITERATIONS // 16
"""Most Newton iterations from one node to the next, and from a node to a point: three transients of 800."""

ITERATIONS_PER_SAVE = 100
"""Newton iterations after which a sweep is saved at its next node, and its factorisation dropped, so that a resumed
sweep is equal to the last bit: 1 s of 48 pairs, 17 s of 336."""


@packable
@dataclass(frozen=True)
class SweepState:
    """State of a sweep at a node, with which the sweep goes on.

    resolution: harmonics and samples of the nodes.
    states: the last one or two nodes, with equal harmonics, the current one last; empty where there is no state.
    length: of the next step.
    checked: the node at which the harmonics were chosen. at_limit: whether it needs more than a sweep may have.
    branch, fold: number of folds jumped over so far, and the parameter at the last of them, NaN if none.
    failure, lost_at: reason why there is no state, and the parameter of the last node before, NaN if there was none.
    iterations: Newton iterations so far.
    reference: state of the reference sweep; None for none.
    """

    resolution: Resolution
    states: tuple[Any, ...] = ()
    length: float = 0.0
    checked: Any = None
    at_limit: bool = False
    branch: int = 0
    fold: float = float("nan")
    failure: Outcome = Outcome.START_FAILED
    lost_at: float = float("nan")
    iterations: int = 0
    reference: SweepState | None = None


class Sweep(Generic[S]):
    """A sweep, node by node, up (direction 1) or down (-1) along the parameter of its path.

    state: at the current node. saved: at the last saved node; a sweep resumed from there is equal to the last bit.
    ahead: the next node, where it is known. last: the last node of a lost sweep.
    passed: parameters of the nodes so far.
    save: called where the sweep was saved.
    wider: factor on the steps, 2 for a reference sweep. reference: the reference sweep, led from node to node.
    """

    def __init__(
        self, path: Path[S], direction: float, budget: Budget, *, wider: float = 1.0, with_reference: bool = False
    ) -> None:
        self.path, self.direction, self.wider = path, direction, wider
        self.run = Run(path.case.settings.tolerance, budget)
        self.state = SweepState(path.case.resolution)
        self.saved: SweepState | None = None
        self.ahead: Step[S] | None = None
        self.last: S | None = None
        self.passed: list[float] = []
        self.save: Callable[[], None] = lambda: None
        # counts of its own: when the sweep is saved must not depend on the points that are asked for
        own = Budget(deadline=budget.deadline)
        self.reference = Sweep(path, direction, own, wider=2.0 * wider) if with_reference else None

    def load(self, state: SweepState) -> None:
        """Go on from the `saved` state of another sweep."""
        self.saved = self.state = state
        self.path = self.path.at(state.resolution)
        self.run.budget.iterations = state.iterations
        self.forget()
        if self.reference is not None and state.reference is not None:
            self.reference.load(state.reference)

    @property
    def n_iterations(self) -> int:
        """Newton iterations so far, those of the reference sweep included."""
        return self.run.budget.iterations + (0 if self.reference is None else self.reference.run.budget.iterations)

    def set_deadline(self, deadline: float) -> None:
        """Set the CPU time of the thread, s, after which the sweep ends."""
        self.run.budget.deadline = deadline
        if self.reference is not None:
            self.reference.run.budget.deadline = deadline

    @property
    def here(self) -> S | None:
        """The current node, None where there is no state."""
        return self.state.states[-1] if self.state.states else None

    def begin(self, path: Path[S], state: S) -> bool:
        """Take the first state, which has the harmonics and samples of a path; False where the state is rejected.

        A state that more harmonics change by more than half is rejected: one harmonic can give a joint that slips and
        opens everywhere a state that does not exist.
        """
        self.place_at(path, state)
        if self._choose_resolution() > SENSITIVE_ERROR:
            self.state = replace(self.state, states=(), failure=Outcome.UNSETTLED)
            return False
        self._save()
        return True

    def lose(self) -> None:
        """End the sweep at the current node."""
        at = self.state.lost_at if self.here is None else self.here.parameter
        self.last = self.here or self.last
        self.drop()
        self.state = replace(self.state, lost_at=at)

    def drop(self) -> None:
        """Be without a state, as a reference sweep that does not differ from its sweep."""
        self.state, self.ahead = replace(self.state, states=()), None

    def has_passed(self, parameter: float) -> bool:
        """Whether a value of the parameter lies before the current node, or before the end of a lost sweep."""
        last = self.state.lost_at if self.here is None else self.here.parameter
        return (parameter - last) * self.direction < 0.0

    def advance_to(self, parameter: float) -> None:
        """Go on until the next node lies at or beyond a value of the parameter, or until the branch is lost."""
        try:
            while self.here is not None:
                if self.ahead is None:
                    self._look_ahead(self.here)
                elif (self.ahead.state.parameter - parameter) * self.direction >= 0.0:
                    return
                else:
                    self._advance(self.ahead)
        except np.linalg.LinAlgError:
            self.lose()

    def state_at(self, parameter: float, run: Run) -> Step[S] | Outcome:
        """State at a parameter between the current and the next node, or why there is none.

        A state beyond a fold is solved backwards from the next node, to which the sweep has jumped.
        run: of its own; the sweep must not depend on this state.
        """
        if self.here is None or self.ahead is None:
            return self.state.failure
        ahead = self.ahead
        beyond = tuple(at for at in ahead.folds if (parameter - at) * self.direction > 0.0)
        if beyond and parameter != ahead.state.parameter:
            found = _reach(self.path, (ahead.state,), parameter, run)
            if isinstance(found, Step) and not found.folds:
                return replace(found, folds=beyond)
        near = () if ahead.folds else (ahead.state,)
        return _reach(self.path, (*near, self.here), parameter, run)

    def reference_at(self, parameter: float, run: Run) -> S | None:
        """State of the reference sweep at a parameter between the current and the next node; None if there is none."""
        if self.reference is None or self.reference_node(parameter) is None:
            return None
        found = self.reference.state_at(parameter, run)
        return None if isinstance(found, Outcome) else found.state

    def reference_node(self, parameter: float) -> S | None:
        """Last node of the reference sweep before a parameter; None where it has no state of its own."""
        if self.reference is not None:
            self.reference.advance_to(parameter)
        return None if self.reference is None else self.reference.here

    # the line of `take_step`

    def attempt(self, here: S, length: float) -> Step[S] | None:
        """As in Line."""
        run = self.run.to(self.path.node_tolerance)
        found = self.path.solve(self.state.states, self._target(here, length), run)
        return None if found is None else Step(found)

    def judge(self, here: S, end: Step[S], length: float) -> float:
        """As in Line: the shortest step is accepted, whatever the change of the vibration is."""
        ratio = self.path.change(here, end.state, self.wider)
        return min(ratio, 1.0) if length <= self.path.steps[0] else ratio

    def rescue(self, here: S, length: float) -> Step[S] | Failure:
        """As in Line."""
        found = self.path.rescue(here, self._target(here, length), self.run)
        return Failure(found) if isinstance(found, Outcome) else found

    def _target(self, here: S, length: float) -> float:
        return self.path.ahead(here.parameter, self.direction * length)

    def _look_ahead(self, here: S) -> None:
        """Find the next node, or lose the sweep."""
        budget, (shortest, longest, rescue) = self.run.budget, self.path.steps
        budget.report(self.path.describe(here))
        budget.limit = budget.iterations + NODE_ITERATIONS
        taken: tuple[Step[S], float] | Failure = Failure(Outcome.BRANCH_LOST)
        if budget.iterations <= SWEEP_ITERATIONS:
            taken = take_step(self, here, self.state.length, Lengths(1, AIMED_CHANGE, shortest, rescue))
        if isinstance(taken, Failure):
            self.state = replace(self.state, failure=taken.outcome)
            self.lose()
        else:
            self.ahead, length = taken
            self.state = replace(self.state, length=min(length, longest))

    def _advance(self, step: Step[S]) -> None:
        """Make the next node the current one."""
        before, self.ahead = self.here, None
        self.passed.append(step.state.parameter)
        self.state = replace(
            self.state,
            states=(step.state,) if step.folds else (before, step.state),
            branch=self.state.branch + len(step.folds),
            fold=(self.state.fold, *step.folds)[-1],
        )
        if self.reference is not None and before is not None:
            self._lead(self.reference, before, step)
        if self.state.checked is None:
            return
        if self.path.differs(self.state.checked, step.state) > ACCURACY.vibration_recheck:
            if self.path.suffices(step.state, self.state.at_limit, self.run):
                self.state = replace(self.state, checked=step.state)
            else:
                self._choose_resolution()
        saved = 0 if self.saved is None else self.saved.iterations
        if self.run.budget.iterations >= saved + ITERATIONS_PER_SAVE:
            self._save()

    def _lead(self, reference: Sweep[S], before: S, step: Step[S]) -> None:
        """Lead the reference sweep to the present node: the end of a step from the node `before`."""
        if step.folds or self.path.forgets(step.state):
            reference.drop()
            return
        if reference.here is None and not self.path.rests(step.state):
            self._begin_reference(reference, before)
        reference.advance_to(step.state.parameter)
        if reference.state.branch > 0:
            reference.drop()

    def _begin_reference(self, reference: Sweep[S], node: S) -> None:
        """Begin the reference sweep at a node, with harmonics one level lower."""
        path, moved = self.path.at(fewer(self.state.resolution, self.path.case.settings)), None
        if path.case.resolution != self.state.resolution:
            moved = self.path.move(node, path, self.run)
        placed = (self.path, node) if moved is None else (path, moved)
        reference.state = replace(reference.state, branch=0)
        reference.place_at(*placed, reference.wider * self.state.length)

    def place_at(self, path: Path[S], state: S, length: float = np.inf) -> None:
        """Put the sweep at a first node; length: of the first step."""
        self.forget()
        self.path, self.passed, length = path, [state.parameter], min(length, path.steps[1])
        self.state = replace(self.state, states=(state,), resolution=path.case.resolution, length=length)

    def _choose_resolution(self) -> float:
        """Choose the harmonics and samples of the nodes for the current state, as far as they are automatic.

        Returns the estimated relative error of the response, 0 for fixed settings.
        """
        here, error = self.state.states[-1], 0.0
        if self.path.case.settings.automatic:
            path, here, accurate, error = self.path.choose(here, self.run)
            self.state = replace(self.state, at_limit=not accurate)
            self.take(path, here)
        self.state = replace(self.state, checked=here)
        return error

    def take(self, path: Path[S], state: S) -> None:
        """Take the current node with the harmonics and samples of a path; those of the reference sweep follow."""
        if path.case.resolution == self.state.resolution:
            self.state = replace(self.state, states=(*self.state.states[:-1], state))
            return
        self.path, self.run = path, self.run.fresh()
        self.state = replace(self.state, states=(state,), resolution=path.case.resolution)
        other = self.reference
        if other is not None and other.here is not None:
            wanted = path.at(fewer(path.case.resolution, path.case.settings))
            moved = other.path.move(other.here, wanted, self.run)
            if moved is None:
                self._begin_reference(other, state)
            else:
                other.forget()
                other.take(wanted, moved)

    def _save(self) -> None:
        """Save the current node, and drop all that a resumed sweep would not have."""
        other = None
        if self.reference is not None:
            other = replace(self.reference.state, iterations=self.reference.run.budget.iterations)
        self.state = in_rows(replace(self.state, iterations=self.run.budget.iterations, reference=other))
        self.forget()
        if self.reference is not None and self.state.reference is not None:
            self.reference.state = self.state.reference
            self.reference.forget()
        self.saved = self.state
        self.save()

    def forget(self) -> None:
        """Drop the factorisation that is kept from node to node, and the next node."""
        self.run, self.ahead = self.run.fresh(), None


def _reach(path: Path[S], states: tuple[S, ...], target: float, run: Run) -> Step[S] | Outcome:
    """State at a target from the last of some states, or why there is none."""
    found = path.solve(states, target, run)
    return path.rescue(states[-1], target, run) if found is None else Step(found)
