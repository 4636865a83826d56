"""The static state of a joint: contact, friction and equilibrium under a load that rises from zero.

The state depends on the history of the load. So the load is raised in equal steps, and each step starts from the
tangential state of the step before. Newton's method finds most steps at once. Where the first iterations do not show
which pairs slip, in which direction, and which are open, they cycle among sets of pairs; without gaps a shorter step
has the same sets. The step is then made in time, as a joint with viscous pairs makes it:

    c (u - u_before) + Z_r u + lambda = F_r

in steps of implicit Euler, with c in proportion to the penalty of each pair. A large c binds each pair to its last
position: the pairs hardly act on each other, and the state is unique for any friction. From step to step c falls,
until Newton's method finds the state with c = 0: its slip is that since the last viscous step. Also a joint that has
to jump moves on (a snap under much friction, a body that falls through a gap), and a joint without any static state
moves without end, in a direction that shows why.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from solver.continuation.options import CONTINUATION
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.state import State
from solver.model import FloatArray
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import NEGLIGIBLE
from solver.structure.fourier import change_orders
from solver.structure.joint import Case, Joint, static_joint, viscous_joint


def solve_static_state(joint: Joint, wear_depth: FloatArray, run: Run) -> State | Outcome:
    """Static state with unilateral contact and friction, Eqs. (3), (4) and (8), under a load that rises from zero.

    Without gaps and wear the state grows in proportion to its load, as the first iterate of a step does. In the first
    evaluation of the first step all pairs stick.

    Parameters
    ----------
    joint : Joint
        The joint; its excitation is left out.
    wear_depth : array (n_contact,)
        Wear depth, m, held.
    run : Run
        Tolerance and limits.

    Returns
    -------
    State or Outcome
        The parameter of the state is the load factor, 1. STATIC_SLIDING or STATIC_OPEN where there is no static state,
        STATIC_FAILED where none is found.
    """
    run, n_steps = run.fresh(), CONTINUATION.load_steps
    unmoved = np.zeros((joint.contact.n_contact, 3, 1))
    rest = Balance(static_joint(joint, 0.0), unmoved[:, 1:, 0], wear_depth)
    state = State(rest.evaluate(rest.predict(unmoved, unmoved)), rest.history, 0.0)
    for step in range(1, n_steps + 1):
        balance = Balance(static_joint(joint, step / n_steps), state.history, wear_depth)
        before = state.evaluation.predicted_h
        start = balance.joint.structure.force_h() if step == 1 else before * (step / (step - 1.0))
        found = run.state(balance, start)
        if found is None:
            used = run.budget.iterations
            settled = _settle(balance, state.evaluation, run)
            # every search needs a static state, whose steps have a limit of their own
            run.budget.limit += run.budget.iterations - used
            if isinstance(settled, Outcome):
                return settled
            found = settled
        state = replace(found, parameter=step / n_steps)
    return state


def predicted_at_rest(case: Case, quiet: Joint, static: State, wear_depth: FloatArray) -> FloatArray:
    """Predicted force (n_rel, 2H+1), N, of the static state with the harmonics of a case, none of which vibrates.

    quiet: the joint without excitation, at the harmonics of the case.
    """
    displacement_h, force_h = (
        change_orders(part, (), case.resolution.orders)
        for part in (static.evaluation.displacement_h, static.evaluation.force_h)
    )
    return Balance(quiet, static.history, wear_depth).predict(displacement_h, force_h)


def _settle(balance: Balance, before: Evaluation, run: Run) -> State | Outcome:
    """Static state to which viscous pairs come from the state `before`, or why there is none."""
    most, viscosity, begun = CONTINUATION.near_iterations, 1.0, before.displacement_h
    far, moved = float((balance.joint.contact.gap + balance.wear_depth).max()), np.zeros_like(begun)
    for _ in range(CONTINUATION.viscous_steps):
        viscous = replace(balance, joint=viscous_joint(balance.joint, viscosity, before.displacement_h))
        ahead = run.state(viscous, viscous.predict(*_motion(before)), most=most)
        if ahead is None:
            viscosity *= CONTINUATION.viscosity_rise
            continue
        before = ahead.evaluation
        balance = replace(balance, history=ahead.history)
        end = run.state(balance, balance.predict(*_motion(before)), most=most)
        if end is not None:
            return end
        if not moved.any():
            # the first step is about as long as the load deforms the joint
            far = max(far, CONTINUATION.runaway * float(np.abs(before.displacement_h - begun).max()))
        moved = before.displacement_h - begun
        if viscosity < NEGLIGIBLE and np.abs(moved).max() > far:
            break
        viscosity *= CONTINUATION.viscosity_cut
    return _unheld(moved) if np.abs(moved).max() > far else Outcome.STATIC_FAILED


def _motion(at: Evaluation) -> tuple[FloatArray, FloatArray]:
    """Displacement, m, and contact force, N, of a state, both (n_contact, 3, 1)."""
    return at.displacement_h, at.force_h


def _unheld(moved: FloatArray) -> Outcome:
    """Why a joint has no static state, from the displacements (n_contact, 3, 1), m, of its motion without end."""
    opened, slid = -moved[:, 0].min(initial=0.0), np.linalg.norm(moved[:, 1:], axis=1).max(initial=0.0)
    return Outcome.STATIC_OPEN if opened > slid else Outcome.STATIC_SLIDING
