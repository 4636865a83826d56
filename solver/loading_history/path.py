"""The unworn joint along its frequency or its excitation: from a stable state to a stable state.

`LoadingPath.solve` solves one balance, with a linear extrapolation of the last two states as its start. Where Newton's
method fails or the state is unstable, `LoadingPath.rescue` searches by smaller natural steps, by arc-length
continuation through folds, and by integration in time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.accuracy.period_events import nothing_happens
from solver.contact.coulomb import SEPARATED, STICK, friction_limit
from solver.continuation.arc_length import Arc, follow_arc
from solver.continuation.natural import follow_naturally
from solver.continuation.options import CONTINUATION
from solver.continuation.transient import relax_to_periodic
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.prolongation import carried_history
from solver.harmonic_balance.state import State, history_at_rest, vibration_change, vibration_size
from solver.loading_history.node_resolution import choose_resolution, resolution_holds
from solver.loading_history.options import LOADING
from solver.loading_history.path_of_states import Step
from solver.model import FloatArray
from solver.newton.linear_solver import FORCING
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import Resolution
from solver.stability.hill import is_stable
from solver.structure.joint import Case, Joint


@dataclass(frozen=True)
class LoadingPath:
    """The unworn joint along its frequency or its excitation, which is the parameter of the path.

    case: model, friction and settings.
    excitation_amplitude: N.
    omega: None where the parameter is the frequency, rad/s; else the fixed frequency, rad/s, and the parameter is the
        load factor on the amplitude.
    """

    case: Case
    excitation_amplitude: float
    omega: float | None = None

    def joint_at(self, parameter: float) -> Joint:
        """Joint at a value of the parameter."""
        if self.omega is None:
            return self.case.joint(parameter, self.excitation_amplitude)
        return self.case.joint(self.omega, parameter * self.excitation_amplitude)

    def balance_at(self, parameter: float, history: FloatArray) -> Balance:
        """Unworn balance at a value of the parameter. history (n_contact, 2): m."""
        return Balance(self.joint_at(parameter), history, np.zeros(self.case.model.contact.n_contact))

    def scale(self, parameter: float) -> float:
        """Reference value for the lengths of steps."""
        return abs(parameter) if self.omega is None else 1.0

    @property
    def steps(self) -> tuple[float, float, float]:
        """Shortest and longest step over the scale, and the one at which a state is left to `rescue`."""
        return LOADING.shortest_sweep_step, LOADING.longest_sweep_step, LOADING.free_step

    @property
    def node_tolerance(self) -> float:
        """As in Path."""
        return max(self.case.settings.tolerance, FORCING * self.case.settings.rtol)

    def ahead(self, parameter: float, length: float) -> float:
        """The parameter a step farther; length: over the scale, below 0 for a step down."""
        target = parameter + length * self.scale(parameter)
        if self.omega is None:
            return target
        # a ramp ends at its whole load
        return min(target, 1.0) if length > 0.0 else max(target, 1.0)

    def solve(self, states: tuple[State, ...], target: float, run: Run) -> State | None:
        """Stable state at a value of the parameter by Newton's method alone; None where none is found.

        states: one or two states of the branch with equal harmonics. Newton's method starts on the line through them.
            The tangential history comes from the last one.
        """
        start = states[-1]
        joint, begin = self.joint_at(target), start.evaluation.predicted_h
        balance = Balance(joint, history_at_rest(joint, start), start.evaluation.wear_depth)
        if len(states) > 1:
            ratio = (target - start.parameter) / (start.parameter - states[0].parameter)
            begin = begin + ratio * (begin - states[0].evaluation.predicted_h)
        found = run.state(balance, begin, target, CONTINUATION.near_iterations)
        return found if found is not None and is_stable(balance, found.evaluation, run) else None

    def reach(self, states: tuple[State, ...], target: float, run: Run) -> Step[State] | Outcome:
        """Stable state at a target from the last of some states, by `solve` or by `rescue`; or why there is none."""
        found = self.solve(states, target, run)
        return self.rescue(states[-1], target, run) if found is None else Step(found)

    def rescue(self, start: State, target: float, run: Run) -> Step[State] | Outcome:
        """Stable state at a target from a state with equal harmonics and samples, or the reason why there is none."""
        start = replace(start, history=history_at_rest(self.joint_at(start.parameter), start))
        fine = LOADING.free_step * self.scale(target)
        folds: list[float] = []

        def accepted(state: State) -> bool:
            return is_stable(self.balance_at(state.parameter, state.evaluation.history), state.evaluation, run)

        while not run.budget.exhausted:
            state, arrived = follow_naturally(self.balance_at, start, target, run, fine=fine)
            if arrived and accepted(state):
                return Step(state, tuple(folds))
            # natural steps may have passed the unknown start of an unstable part: then the search begins before them
            end = start if arrived else state
            arc = Arc(self.balance_at, end, CONTINUATION.arc_span * self.scale(target), run)
            found = follow_arc(arc, target, accepted, beyond=False)
            if found.state is not None:
                return Step(found.state, (*folds, *found.jumps))
            if arrived and not found.folds and abs(target - end.parameter) > fine:
                # a shorter step comes closer to the loss of stability without a fold
                return Outcome.UNSTABLE
            landed = self._settled(end, target, found.folds, run)
            if isinstance(landed, Outcome):
                return landed
            folds.extend(landed.folds)
            if landed.state.parameter == target:
                return Step(landed.state, tuple(folds))
            start = landed.state
        return Outcome.BRANCH_LOST

    def _settled(self, end: State, target: float, folds: tuple[float, ...], run: Run) -> Step[State] | Outcome:
        """State to which the structure settles in time from the end of a branch, a little beyond this end."""
        fine = LOADING.free_step * self.scale(end.parameter)
        beyond = end.parameter + float(np.clip(target - end.parameter, -fine, fine))
        joint, before = (self.joint_at(at) for at in (beyond, end.parameter))
        unworn = np.zeros(self.case.model.contact.n_contact)
        found = relax_to_periodic(self.case, joint, unworn, end.evaluation, before, end.history, run)
        if isinstance(found, Outcome):
            return found
        landed = replace(found, parameter=beyond)
        if vibration_change(end.evaluation, found.evaluation) <= CONTINUATION.smooth_change:
            return Step(landed)
        # an arc that ended beyond the fold has found the fold all the same
        farthest = max((end.parameter, *folds), key=lambda at: (at - end.parameter) * (target - end.parameter))
        return Step(landed, (farthest,))

    def change(self, before: State, after: State, wider: float) -> float:
        """Change of the vibration in a step over the largest change allowed, times `wider` where pairs slip."""
        one, other = before.evaluation, after.evaluation
        if self.rests(before) and self.rests(after):
            # over a whole resonance, where the phase reverses, the change is larger than 1
            return vibration_change(one, other) / CONTINUATION.linear_change
        limit = np.linalg.norm(friction_limit(self.case.friction_coefficient, one.force_h[:, 0, 0]))
        size = max(vibration_size(one), LOADING.small_vibration * float(limit))
        most = LOADING.largest_change(self.case.settings.rtol, wider, sticks=False)
        return float(np.linalg.norm((other.predicted_h - one.predicted_h)[:, 1:])) / (size * most)

    def rests(self, state: State) -> bool:
        """As in Path."""
        return nothing_happens(state.evaluation)

    def forgets(self, state: State) -> bool:
        """As in Path; slip over less than a fraction of the motion of its pair does not count."""
        at = state.evaluation
        opens = (at.status_t == SEPARATED).any(axis=1)
        slip = np.ptp(at.state_t, axis=2).max(axis=1) / self.joint_at(state.parameter).law.state_stiffness
        moved = np.abs(at.displacement_h[:, 1:, 1:]).sum(axis=(1, 2))
        return bool((opens | (slip > LOADING.least_slip * moved)).all())

    def differs(self, before: State, after: State) -> float:
        """Relative change of the vibration between two states, the larger one of both directions."""
        one, other = before.evaluation, after.evaluation
        return max(vibration_change(one, other), vibration_change(other, one))

    def at(self, resolution: Resolution) -> LoadingPath:
        """The path with other harmonics and samples."""
        return replace(self, case=self.case.at(resolution))

    def like(self, node: State, fine: LoadingPath, state: State, run: Run) -> State | None:
        """The state of another path with the tangential history that a node of this path leaves; None if not found."""
        joint, before = fine.joint_at(state.parameter), self.joint_at(node.parameter)
        at = replace(node.evaluation, history=history_at_rest(before, node))
        balance = Balance(joint, carried_history(self.case, joint, at), state.evaluation.wear_depth)
        found = run.fresh().state(balance, state.evaluation.predicted_h, state.parameter, CONTINUATION.near_iterations)
        return found if found is not None and is_stable(balance, found.evaluation, run) else None

    def move(self, state: State, other: LoadingPath, run: Run) -> State | None:
        """The state with the harmonics and samples of another path; None where it is not found."""
        return run.move(self.case, other.joint_at(state.parameter), state)

    def choose(self, state: State, run: Run) -> tuple[LoadingPath, State, bool, float]:
        """Path and state with the harmonics and samples that the state needs, whether they suffice, and the relative
        error of the response.
        """
        found = choose_resolution(self.case, self.joint_at(state.parameter), state, run)
        chosen = replace(found.point, parameter=state.parameter)
        return replace(self, case=found.case), chosen, found.accurate, found.estimate.response

    def suffices(self, state: State, at_limit: bool, run: Run) -> bool:
        """Whether the state has about the harmonics and samples that it needs."""
        return resolution_holds(self.case, self.joint_at(state.parameter), state, at_limit, run)

    def describe(self, state: State) -> str:
        """Parameter of a state and number of its pairs that slip or open, in words."""
        at = f"{state.parameter / (2.0 * np.pi):.6g} Hz" if self.omega is None else f"load factor {state.parameter:.3g}"
        moving = int(np.count_nonzero((state.evaluation.status_t != STICK).any(axis=1)))
        return f"at {at}, {moving} of {len(state.evaluation.status_t)} pairs slip or open"
