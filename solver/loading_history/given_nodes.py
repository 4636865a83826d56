"""A path over given nodes: on to some targets, or the nodes of a sweep that is made again at other depths."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

from solver.accuracy.refinement import VIBRATION_RECHECK
from solver.continuation.first_state import solve_first_state
from solver.continuation.natural import ATTEMPTS, SMOOTH_CHANGE
from solver.harmonic_balance.state import State, vibration_change
from solver.loading_history.path import LoadingPath, Path, S
from solver.newton.run import Run
from solver.packing import packable
from solver.results.history import StartState
from solver.results.state_report import evaluated, periodic_state
from solver.settings import Resolution
from solver.stability.floquet import find_instability
from solver.structure.schur import SingularStructureError

LAST_NODES = 3
"""Last nodes of a sweep: the next one is predicted on the parabola through them. With a straight line the nodes of the
slider take 7 % more iterations. With two and four ring, damper and dovetail agree within 3e-3."""

LARGEST_CHANGE = 2.0
"""Largest change between two nodes of an earlier sweep, over the largest change of a step of a sweep."""


def follow(
    path: Path[S],
    states: tuple[S, ...],
    targets: Sequence[float],
    run: Run,
    rough: Run | None = None,
    halvings: int = 0,
    most: float = math.inf,
) -> tuple[S, ...]:
    """The last states of a path that goes on from some over some targets; none where one of these is not found.

    rough: for the states before the last target; by default `run`. halvings: of a part whose end is not found, or whose
    change, over that of a step of a sweep, is larger than `most`.
    """
    ahead = list(targets)
    while states and ahead:
        after = path.solve(states, ahead[0], run if len(ahead) == 1 else rough or run)
        if after is not None and (math.isinf(most) or path.change(states[-1], after) <= most):
            states = (*states, after)[-LAST_NODES:]
            ahead.pop(0)
        elif halvings == 0:
            return ()
        else:
            halvings -= 1
            ahead.insert(0, 0.5 * (states[-1].parameter + ahead[0]))
    return states


@packable
@dataclass(frozen=True)
class EarlierSweep:
    """A sweep to be made again at other depths. With other nodes, the wear would jump from depth to depth by its error.

    parameters: of its nodes, none if lost. start, resolution: state at its end, and harmonics and samples of the last
    node.
    """

    parameters: tuple[float, ...]
    start: StartState
    resolution: Resolution

    def again(self, path: LoadingPath, run: Run, stride: int, *, with_switching: bool) -> StartState | None:
        """The state at the end, with the errors of the earlier one; None where the sweep has jumped over a fold, there
        is no stable state, or a new sweep has to choose nodes, harmonics and errors: above a change `VIBRATION_RECHECK`
        of the vibration, or `SMOOTH_CHANGE` where each pair slips or opens, so that the state follows from the depths,
        and no node says on which branch it lies.

        path: with harmonics and samples of the state. stride: nodes in a step. with_switching: as `find_instability`.
        """
        start = self.start
        if start.state is None or start.branch > 0:
            return None
        target = start.state.omega if path.omega is None else 1.0
        known, history = evaluated(path.case, start.state), start.state.start_history
        before = replace(known, next_history=history, parameter=target)
        try:
            state, most = path.solve((before,), target, run) if path.forgets(before) else None, SMOOTH_CHANGE
            if state is None or not path.forgets(state):
                state, most = self._over_nodes(path, target, run.fresh(), stride), VIBRATION_RECHECK
            if state is None or vibration_change(before.evaluation, state.evaluation) > most:
                return None
            if find_instability(path.case, state, run, with_switching):
                return None
        except SingularStructureError:
            return None
        return replace(start, state=periodic_state(state), reference=None, newton_iterations=run.budget.iterations)

    def _over_nodes(self, path: LoadingPath, target: float, run: Run, stride: int) -> State | None:
        """The state at a target of the path, over the nodes; None where it is not found."""
        if not self.parameters:
            return None
        coarse, (first, *nodes) = path.at(self.resolution), self.parameters[::stride]
        joint = coarse.joint_at(first)
        begin = solve_first_state(coarse.case, joint.omega, joint.excitation_amplitude, run)
        if not isinstance(begin, State):
            return None
        rough, most = run.with_tolerance(path.case.settings.rough_tolerance), LARGEST_CHANGE * stride
        # past a corner at the resonance: without halvings, half of the sweeps up to 212.6 Hz of the dovetail begin anew
        states = follow(coarse, (replace(begin, parameter=first),), [*nodes, target], run, rough, ATTEMPTS, most)
        if not states:
            return None
        return states[-1] if coarse.case is path.case else path.moved(states[-1], run)
