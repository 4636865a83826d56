"""A slow sweep along a path: states with steps of their own, which leave the joint as the machine would.

Friction gives a joint a family of periodic states. The tangential displacements at which the pairs stick select one,
and these depend on all vibration before. So a sweep has nodes of its own, whose distance depends only on the change of
the vibration. A state between two nodes is solved from the node before and leaves the sweep unchanged. At other depths
a sweep is made again over its nodes (`given_nodes`).

The error of a sweep comes from its steps: from node to node the predicted force goes along a straight line, and pairs
slide as it says (`solver.contact.slow_slide`). A reference sweep has a node in the middle of every second step, and
harmonics one level lower where these are automatic. The reference begins where pairs slip or open, and anew behind a
fold and where each pair slips or opens within the period: such a state follows from its parameter alone.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic

from solver.accuracy.resolved_state import NOTHING, fewer
from solver.continuation.natural import ATTEMPTS, FINE_STEP, LARGEST_STEP_RATIO, Lengths, take_step
from solver.continuation.transient import SEARCH_ITERATIONS
from solver.harmonic_balance.state import Failure
from solver.loading_history.given_nodes import LAST_NODES, follow
from solver.loading_history.path import Path, S, Step
from solver.newton.run import Budget, Run
from solver.outcome import SENSITIVE_ERROR, Outcome
from solver.packing import in_rows

AIMED_CHANGE = 0.75
"""Expected change of the vibration in the next step over the largest change. Few steps are refused. With 0.6 and 0.9
slider, masses, waves and impacts are equal within 1e-3, with 9 % more iterations."""

SWEEP_ITERATIONS = 10 * SEARCH_ITERATIONS
"""Most Newton iterations of a sweep (the dovetail takes 300)."""

NODE_ITERATIONS = 5 * SWEEP_ITERATIONS // 16
"""Most Newton iterations from one node to the next, and from a node to a point: three transients. Also of a wear
history or its reference solution, in addition to `NEAR_ITERATIONS` for each step: a travelling wave at its resonance
takes 1400 in a corner within 500 cycles."""

ITERATIONS_PER_SAVE = 100
"""Newton iterations after which a sweep is saved at its next node: 1 s of 48 pairs, 17 s of 336. Half and twice:
sliders and dovetail are equal to 5e-7, a worn dovetail within its error."""

STEPS_OF_REFERENCE = 2
"""Steps of a sweep in one step of its reference: the errors of both are of second order in the step, and their
difference is three times the smaller one."""

HALVINGS_TO_SLIP = 3
"""Halvings of the step in which slip begins, to find where its reference begins. Dovetail, 16 pairs, 39 harmonics,
212.341 to 212.355 Hz, where rates are 220 to 4 % off: with two, 64 to 1.4 % are told, with three and four 117 to
1.8 %."""

_SAVED = ("nodes", "failure", "length", "rate", "checked", "error", "branch", "fold", "reference", "skipped")
"""Attributes of a `Sweep` with which it goes on from a node, beside the iterations so far."""


@dataclass(eq=False)
class Sweep(Generic[S]):
    """A sweep, node by node, up (sign 1) or down (-1) along the parameter of its path; stepped by `take_step`.

    budget: of the nodes, those of the reference sweep included. save: called where the sweep was saved, as `saved`.
    nodes, ahead: last nodes, and the next one, where it is known. passed: parameters of the nodes so far.
    failure: why there is no state, at the start or behind the last node; None where there is one.
    length: of the next step. rate: change in the last one, over the largest change allowed, per length.
    checked, error: the node at which the harmonics were chosen, and its largest estimated error.
    branch, fold: number of folds jumped over so far, and the parameter at the last of them, NaN if none.
    reference: last nodes of the reference sweep, none before it begins; None where it is lost, until no history lasts.
    skipped: parameters of the nodes since then.
    """

    path: Path[S]
    sign: float
    budget: Budget
    with_reference: bool = True
    save: Callable[[], None] = lambda: None
    nodes: tuple[S, ...] = ()
    ahead: Step[S] | None = None
    passed: list[float] = field(default_factory=list)
    rate: float = 0.0
    checked: S | None = None
    error: float = 0.0
    branch: int = 0
    fold: float = math.nan
    reference: tuple[S, ...] | None = ()
    skipped: tuple[float, ...] = ()
    saved: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.failure: Failure | None = Failure(Outcome.START_FAILED, "no first state is known")
        self.length = self.path.longest
        self.run = self._reference_run = Run(self.path.case.settings.tolerance, self.budget)

    def load(self, saved: dict[str, Any]) -> None:
        """Go on from what another sweep has saved."""
        self.saved, self.budget.iterations = saved, saved["iterations"]
        vars(self).update({name: saved[name] for name in _SAVED})
        self.path = self.path.at(self.nodes[-1].resolution)
        # without the factorisations that are kept from node to node, and the next node
        self.run, self._reference_run, self.ahead = self.run.fresh(), self.run.fresh(), None

    @property
    def last(self) -> S | None:
        """The current node, or the last one of a lost sweep; None where there was none."""
        return self.nodes[-1] if self.nodes else None

    @property
    def here(self) -> S | None:
        """The current node, None where there is no state."""
        return self.last if self.failure is None else None

    def reference_of(self, state: S, run: Run) -> S | Failure | None:
        """State to which the reference sweep leads, with parameter and harmonics of a state, or why its error is not
        known. None where no history lasts to the state.

        Where slip begins between the last node and the state, the reference begins there, and with the harmonics of the
        state, of which nodes without slip may have fewer (dovetail, 16 pairs, 212.35 Hz: 3 for 39, and the wear rate is
        4 % off).
        """
        here, states, path = self.here, self.reference, self.path
        if not self.with_reference:
            return None
        if here is None or states == ():
            if path.rests(state) or path.forgets(state):
                return None
            if here is None:
                return Failure(Outcome.BRANCH_LOST, "no sweep leads to the state, whose friction has a history")
            if not (path.rests(here) or path.forgets(here)):
                return None
            states = self._before_slip(here, state, run)
        found = None if states is None else _led(path.at(state.resolution), states, (state.parameter,), run)
        return found[-1] if found else Failure(Outcome.BRANCH_LOST, "the reference sweep is lost")

    def begin(self, state: S) -> bool:
        """Take the first state, and go on with its harmonics and samples; False where it is rejected.

        One harmonic can give a joint that slips and opens everywhere a state that does not exist: more harmonics change
        it by more than half, and no state with more is found.
        """
        self.path, self.passed, self.nodes = self.path.at(state.resolution), [state.parameter], (state,)
        error = self._choose_resolution()
        if error > SENSITIVE_ERROR and self.path.case.resolution.highest <= state.resolution.highest:
            said = f"more harmonics change the first state, {self.path.describe(state)}, by more than half"
            self.nodes, self.failure = (), Failure(Outcome.UNSETTLED, said)
            return False
        self.failure = None
        self._save()
        return True

    def advance_to(self, parameter: float) -> None:
        """Go on until the next node lies at or beyond a value of the parameter, or the sweep is lost."""
        while (here := self.here) is not None:
            if self.ahead is None:
                self._look_ahead(here)
            elif (self.ahead.state.parameter - parameter) * self.sign >= 0.0:
                return
            else:
                self._advance(here, self.ahead)

    def state_at(self, parameter: float, run: Run) -> Step[S] | Failure:
        """State at a parameter, to which the sweep goes on, or why there is none. run: of this state alone."""
        self.advance_to(parameter)
        if self.here is None or self.ahead is None:
            assert self.failure is not None
            return self.failure
        before, path = self.nodes[:-1], self.path
        near = before if self.ahead.folds else (*before[-1:], self.ahead.state)
        found = path.solve((*near, self.here), parameter, run)
        return path.rescue(self.here, parameter, run) if found is None else Step(found)

    def attempt(self, here: S, length: float) -> Step[S] | None:  # noqa: D102
        run = self.run.with_tolerance(self.path.case.settings.rough_tolerance)
        found = self.path.solve(self.nodes, self.path.ahead(here.parameter, self.sign * length), run)
        return None if found is None else Step(found)

    def ratio(self, here: S, end: Step[S], length: float) -> float:
        """As in SteppedProblem: the shortest step is accepted, whatever the change of the vibration is."""
        ratio = self.path.change(here, end.state)
        self.rate = ratio / length
        return min(ratio, 1.0) if length <= self.path.shortest else ratio

    def rescue(self, here: S, length: float) -> Step[S] | Failure:  # noqa: D102
        return self.path.rescue(here, self.path.ahead(here.parameter, self.sign * length), self.run)

    def _look_ahead(self, here: S) -> None:
        """Find the next node, or lose the sweep."""
        budget, path, before, self.rate = self.budget, self.path, self.rate, 0.0
        budget.report(path.describe(here))
        budget.most_iterations = budget.iterations + NODE_ITERATIONS
        most = f"the sweep has taken more than {SWEEP_ITERATIONS} iterations"
        taken: tuple[Step[S], float] | Failure = Failure(Outcome.BRANCH_LOST, most)
        if budget.iterations <= SWEEP_ITERATIONS:
            taken = take_step(self, here, self.length, Lengths(1, AIMED_CHANGE, path.shortest, FINE_STEP))
        if isinstance(taken, Failure):
            self.failure = taken
            return
        self.ahead, length = taken
        # the change will grow as in the last step: towards a resonance every third step would be refused
        growth = self.rate / before if before > 0.0 else 1.0
        self.length = min(length / min(max(growth, 1.0), LARGEST_STEP_RATIO), path.longest)

    def _advance(self, before: S, step: Step[S]) -> None:
        self.ahead = None
        self.passed.append(step.state.parameter)
        self.nodes = (step.state,) if step.folds else (*self.nodes, step.state)[-LAST_NODES:]
        self.branch, self.fold = self.branch + len(step.folds), (self.fold, *step.folds)[-1]
        if self.with_reference:
            self._lead_reference(before, step)
        if self.checked is None or not self.path.suits(self.checked, self.error, step.state):
            self._choose_resolution()
        if self.budget.iterations >= self.saved["iterations"] + ITERATIONS_PER_SAVE:
            self._save()

    def _lead_reference(self, before: S, step: Step[S]) -> None:
        """Lead the reference sweep over a step from the node `before`: to its middle, if it is a third step."""
        if step.folds or self.path.forgets(step.state):
            self.reference, self.skipped = (), ()
            return
        if self.reference == ():
            if self.path.rests(step.state):
                return
            self.reference = self._before_slip(before, step.state, self.run)
        self.skipped = (*self.skipped, step.state.parameter)
        if self.reference is not None and len(self.skipped) == STEPS_OF_REFERENCE:
            path = self.path.at(fewer(self.path.case.resolution, self.path.case.settings))
            if self.reference[-1].resolution != path.case.resolution:
                self._reference_run = self.run.fresh()
            rough = self._reference_run.with_tolerance(path.case.settings.rough_tolerance)
            middle = 0.5 * (before.parameter + step.state.parameter)
            found = _led(path, self.reference, (middle,), rough)
            self.reference = found or _led(path, self.reference, (*self.skipped[:-1], middle), rough) or None
            self.skipped = ()

    def _before_slip(self, before: S, after: S, run: Run) -> tuple[S] | None:
        """Last state without slip that is found on the way from a node to a state where pairs slip, or the node; None
        where no state is found between them.

        The sweep itself goes from node to state on one straight line, as a reference that begins at the node would.
        """
        if not self.path.rests(before):
            return (before,)
        step, run, between = after.parameter - before.parameter, run.fresh(), False
        for _ in range(HALVINGS_TO_SLIP):
            step *= 0.5
            state = self.path.solve((before,), before.parameter + step, run)
            between = between or state is not None
            before = state if state is not None and self.path.rests(state) else before
        return (before,) if between else None

    def _choose_resolution(self) -> float:
        """Choose automatic harmonics and samples of the nodes; returns the estimated relative error of the response."""
        self.checked, error = self.nodes[-1], NOTHING
        if self.path.case.settings.automatic:
            self.checked, error = self.path.choose(self.checked, self.run)
            path = self.path.at(self.checked.resolution)
            if path is self.path:
                self.nodes = (*self.nodes[:-1], self.checked)
            else:
                self.nodes, self.path, self.run = (self.checked,), path, self.run.fresh()
        self.error = error.largest
        return error.response

    def _save(self) -> None:
        """Save the current node, and go on as a sweep that is resumed there."""
        self.load(in_rows({name: vars(self)[name] for name in _SAVED} | {"iterations": self.budget.iterations}))
        self.save()


def _led(path: Path[S], states: tuple[S, ...], targets: Sequence[float], run: Run) -> tuple[S, ...]:
    """As `follow`, from states that may have other harmonics and samples than the path."""
    if (resolution := states[-1].resolution) == path.case.resolution:
        return follow(path, states, targets, run, halvings=ATTEMPTS)
    if (moved := path.moved(states[-1], run)) is not None:
        return follow(path, (moved,), targets, run, halvings=ATTEMPTS)
    # there may be no state with these harmonics at the node, as there is one farther on
    found = follow(path.at(resolution), states, targets, run.fresh(), halvings=ATTEMPTS)
    moved = path.moved(found[-1], run) if found else None
    return () if moved is None else (moved,)
