"""The first periodic state of a joint, from its static state."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from solver.contact.coulomb import friction_limit
from solver.continuation.natural import NEAR_ITERATIONS, follow_naturally
from solver.continuation.static_state import predicted_at_rest, solve_static_state
from solver.continuation.transient import relax_to_periodic
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import State
from solver.model import ComplexArray, FloatArray
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.stability.floquet import is_stable
from solver.structure.joint import Case, Joint

RELIEF = (0.1, 0.4)
"""Fractions of the static friction forces that are removed where the excitation cannot be raised with the full forces.
Other fractions lead to other states that friction allows: 5 % for a mass that ratchets."""

LINEARISATIONS = 20
"""Iterations of the harmonic linearisation."""


def solve_first_state(
    case: Case, omega: float, excitation_amplitude: float, wear_depth: FloatArray, run: Run
) -> State | Outcome:
    """First periodic state. These ways are tried in turn until one leads to a stable state:

    1. Where friction cannot hold any pair against the whole excitation, Newton's method starts from a vibration in
       which all slide (three to four iterations for the slider, which takes 30 to 90 with the next way).
    2. The excitation is raised from zero.
    3. The excitation is raised from a state with smaller static friction forces. Pairs that the static load leaves at
       their friction limit slip under the smallest vibration, in states far from the static one, and shake down.
    4. The vibration builds up in time under the whole excitation (`transient`).

    omega, excitation_amplitude: rad/s, N. wear_depth (n_contact,): m, constant.

    Returns the state, or START_FAILED, UNSTABLE, UNSETTLED, ADRIFT or an outcome of `solve_static_state`.
    """
    quiet = case.joint(omega, 0.0)
    static = solve_static_state(quiet, wear_depth, run)
    if isinstance(static, Outcome):
        return static
    why, unstable = Outcome.START_FAILED, False
    for found in _ways(case, quiet, static, excitation_amplitude, run):
        if isinstance(found, Outcome):
            why = found
            continue
        balance = Balance(case.joint(omega, excitation_amplitude), found.evaluation.history, wear_depth)
        if is_stable(balance, found.evaluation, run):
            return found
        unstable = True
    return Outcome.UNSTABLE if unstable else why


def _ways(case: Case, quiet: Joint, static: State, excitation_amplitude: float, run: Run) -> Iterator[State | Outcome]:
    """States under the whole excitation by the ways of `solve_first_state`, or why the last one ends, on demand."""
    wear_depth = static.evaluation.wear_depth

    def balance_at(load_factor: float, history: FloatArray) -> Balance:
        return Balance(case.joint(quiet.omega, load_factor * excitation_amplitude), history, wear_depth)

    start = predicted_at_rest(case, quiet, static, wear_depth)
    rest = run.state(balance_at(0.0, static.history), start, 0.0)
    if rest is None:
        yield Outcome.START_FAILED
        return
    whole = balance_at(1.0, rest.history)
    if (sliding := _sliding_start(whole, rest)) is not None:
        slid = run.state(whole, sliding, 1.0, NEAR_ITERATIONS)
        if slid is not None:
            yield slid
    for fraction in (0.0, *RELIEF):
        begun: State | None = rest
        if fraction:
            relieved = Balance(quiet, relieved_history(quiet, static, fraction), wear_depth)
            begun = run.state(relieved, start, 0.0)
        if begun is not None:
            raised, arrived = follow_naturally(balance_at, begun, 1.0, run)
            if arrived:
                yield raised
    yield relax_to_periodic(case, whole.joint, wear_depth, rest.evaluation, quiet, rest.history, run)


def _sliding_start(balance: Balance, rest: State) -> FloatArray | None:
    """Predicted force (n_rel, m), N, of a joint all of whose pairs slide; None where friction may hold one of them.

    Friction acts against the velocity with its first harmonic, 4 / pi times its limit (harmonic linearisation).
    """
    joint = balance.joint
    load, stiffness = joint.structure.harmonic_force, joint.structure.dynamic_stiffness[0]
    limit = friction_limit(joint.friction_coefficient, rest.evaluation.force_h[:, 0, 0])

    def of_pairs(amplitudes: ComplexArray) -> ComplexArray:
        spread = np.zeros(3 * limit.size, complex)
        spread[joint.component_index] = amplitudes
        return spread.reshape(-1, 3)

    if (np.linalg.norm(of_pairs(load)[:, 1:], axis=1) <= limit).any():
        return None
    friction, moved = np.zeros((limit.size, 3), complex), load.astype(np.complex128)
    for _ in range(LINEARISATIONS):
        left = load - friction.ravel()[joint.component_index]
        moved = np.asarray(np.linalg.solve(stiffness, left), dtype=np.complex128)
        velocity = 1j * of_pairs(moved)[:, 1:]
        size = np.maximum(np.linalg.norm(velocity, axis=1), 1e-300)
        friction[:, 1:] = (4.0 / np.pi * limit / size)[:, None] * velocity
    motion_h, force_h = rest.evaluation.displacement_h.copy(), rest.evaluation.force_h.copy()
    for values, amplitude in ((motion_h, of_pairs(moved)), (force_h, friction)):
        values[:, :, 1], values[:, :, 2] = amplitude.real, -amplitude.imag
    return balance.predict(motion_h, force_h)


def relieved_history(joint: Joint, static: State, fraction: float) -> FloatArray:
    """Tangential history (n_contact, 2), m, that reduces the static friction forces by a fraction."""
    return static.history + fraction * static.evaluation.force_h[:, 1:, 0] / joint.penalty.tangential[:, None]
