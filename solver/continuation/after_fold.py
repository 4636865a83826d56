"""Stable states behind a fold: candidates for the vibration when its branch ends while the joint wears."""

from __future__ import annotations

from collections.abc import Iterator

from solver.continuation.arc_length import Arc, follow_arc
from solver.continuation.first_state import solve_first_state
from solver.continuation.options import CONTINUATION
from solver.continuation.transient import relax_to_periodic
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import State
from solver.model import FloatArray
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.stability.hill import is_stable
from solver.structure.joint import Case, Joint


def states_after_fold(case: Case, joint: Joint, last: State, worn: FloatArray, run: Run) -> Iterator[State | Outcome]:
    """Stable states behind the end of a branch, in the order of physical preference. Each is computed on demand.

    1. The periodic state to which the structure relaxes in time, at the wear depth behind the end.
    2. States of the branch at the depth of the last state: the branch is followed along the frequency through its folds
       and back to the frequency of the last state.
    3. A first state, computed from rest (`first_state`).

    Parameters
    ----------
    case, joint : Case, Joint
        Model, settings and joint at the end of the branch.
    last : State
        The last state of the branch.
    worn : array (n_contact,)
        Wear depth just behind the end of the branch, m.
    run : Run
        Tolerance and limits.

    Yields
    ------
    State or Outcome
        States, and at the end the outcome where the last attempt fails. Where the mean positions run away in the
        relaxation (ADRIFT), no other attempt is made.
    """
    relaxed = relax_to_periodic(case, joint, worn, last.evaluation, joint, last.history, run)
    if isinstance(relaxed, State):
        yield relaxed
    elif relaxed is Outcome.ADRIFT:
        yield relaxed
        return
    before = last.evaluation.wear_depth

    def balance_at(omega: float, history: FloatArray) -> Balance:
        return Balance(case.joint(omega, joint.excitation_amplitude), history, before)

    def accepted(state: State) -> bool:
        return is_stable(balance_at(state.parameter, state.history), state.evaluation, run)

    # the target is the frequency of the last state
    start = State(last.evaluation, last.evaluation.history, joint.omega)
    arc = Arc(balance_at, start, CONTINUATION.arc_span * joint.omega, run)
    for toward in (-1.0, 1.0):
        found = follow_arc(arc, joint.omega, accepted, toward)
        if found.state is not None and found.folds:
            yield found.state
    yield solve_first_state(case, joint.omega, joint.excitation_amplitude, worn, run)
