"""The static state of a joint, and its first periodic state from there.

The static state depends on the history of the load. So the load is raised in equal steps, each from the tangential
state of the step before. Where Newton's method cycles among sets of pairs that slip and open, the step is made in time,
as a joint with viscous pairs makes it, by implicit Euler:

    c (u - u_before) + Z_r u + lambda = F_r

A large c, in proportion to the penalty of each pair, binds the pair to its last position, and the state is unique for
any friction. From step to step c falls, until Newton's method finds the state with c = 0. A joint without any static
state moves without end, in a direction that shows why.
"""

from dataclasses import replace

import numpy as np

from solver.contact.coulomb import friction_limit
from solver.continuation.natural import NEAR_ITERATIONS, SMALLEST_STEP_RATIO, follow_naturally
from solver.continuation.transient import RUNAWAY, SEARCH_ITERATIONS, relax_to_periodic
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.ring_state import at_rest, everywhere
from solver.harmonic_balance.state import Failure, State, balance_after, state_of
from solver.model import FloatArray
from solver.newton.run import Run
from solver.outcome import Outcome
from solver.settings import NEGLIGIBLE
from solver.structure.fourier import change_orders
from solver.structure.joint import Case, Joint, static_joint, viscous_joint

LOAD_STEPS = 20
"""Steps of the static load of a joint with gaps or given normal forces, which may change the state. With 10 and 40
vibro-impact, its mode and a ring are equal, and take as many iterations fewer or more."""

RELIEF = 0.4
"""Fraction of the static friction forces that is removed where the excitation cannot be raised with the full forces.
Other fractions lead to other states that friction allows: 5 % for a mass that ratchets. With 0.1 before it blocks,
waves, modes and impacts are equal, and those that fail take 5 % more iterations."""


def solve_first_state(case: Case, omega: float, excitation_amplitude: float, run: Run) -> State | Failure:
    """First stable periodic state of a joint, unworn or with its depths as gaps, by the first way that finds one:

    1. Where friction can hold no pair against the whole excitation, Newton's method starts from a vibration in which
       all slide (four iterations for the slider, which takes 50 with the next way).
    2. The excitation is raised from zero.
    3. The excitation is raised from smaller static friction forces: pairs that the static load leaves at their friction
       limit slip under the smallest vibration, in states far from the static one, and shake down.
    4. The vibration builds up in time under the whole excitation (`transient`).

    omega, excitation_amplitude: rad/s, N. Returns the state, or the failure of `state_at_rest` or `relax_to_periodic`.
    """
    rest = state_at_rest(case, omega, run)
    if isinstance(rest, Failure):
        return rest
    quiet, unstable = case.joint(omega, 0.0), False
    whole = Balance(case.joint(omega, excitation_amplitude), rest.next_history)

    def balance_from(load_factor: float, state: State) -> Balance:
        return balance_after(case.joint(omega, load_factor * excitation_amplitude), state)

    sliding = sliding_start(whole, rest)
    slid = None if sliding is None else run.state(whole, sliding, 1.0, NEAR_ITERATIONS)
    if slid is not None and run.is_stable(whole.joint, slid.evaluation):
        return slid
    friction = rest.evaluation.force_h[:, 1:, 0]
    for fraction in (0.0, RELIEF):
        relieved = Balance(quiet, quiet.law.relieved(rest.next_history, fraction * friction))
        begun = run.state(relieved, rest.evaluation.predicted_h, 0.0) if fraction else rest
        if begun is None:
            continue
        raised, arrived = follow_naturally(balance_from, begun, 1.0, run)
        if arrived and run.is_stable(whole.joint, raised.evaluation):
            return raised
        unstable |= arrived
    settled = relax_to_periodic(whole.joint, rest.evaluation.slow, rest, quiet, run)
    return Failure(Outcome.UNSTABLE, settled.message) if unstable and isinstance(settled, Failure) else settled


def state_at_rest(case: Case, omega: float, run: Run) -> State | Failure:
    """The static state with the harmonics of a case, none of which vibrates, at the frequency omega, rad/s, and with
    the parameter 0; or START_FAILED or the failure of `solve_static_state`.
    """
    quiet = case.joint(omega, 0.0)
    static = solve_static_state(quiet, run)
    if isinstance(static, Failure):
        return static
    balance, at, orders = Balance(quiet, static.next_history), static.evaluation, case.resolution.orders
    start = balance.predict(*(change_orders(part, (), orders) for part in (at.displacement_h, at.force_h)))
    said = f"the static state is not found again with {case.resolution.highest} harmonics"
    return run.state(balance, start, 0.0) or Failure(Outcome.START_FAILED, said)


def sliding_start(balance: Balance, rest: State) -> FloatArray | None:
    """Predicted force (n_rel, m), N, of a joint all of whose pairs slide; None where friction may hold one of them.

    The motion is that without friction; friction acts against it with its first harmonic, 4 / pi times its limit.
    """
    structure, at, rows = balance.joint.structure, rest.evaluation, balance.joint.contact.pair_rows
    load, limit = structure.harmonic_force, friction_limit(balance.joint.contact.friction, at.force_h[:, 0, 0])
    pushed = np.where(rows >= 0, load[rows], 0.0)
    if (np.linalg.norm(pushed[:, 1:], axis=1) <= limit).any():
        return None
    moved = np.where(rows >= 0, structure.moving.solve(slice(1), load[:, None])[rows, 0], 0.0)
    friction, size = np.zeros_like(moved), np.maximum(np.linalg.norm(moved[:, 1:], axis=1), 1e-300)
    friction[:, 1:] = (4j / np.pi * limit / size)[:, None] * moved[:, 1:]
    motion_h, force_h = at.displacement_h.copy(), at.force_h.copy()
    for values, amplitude in ((motion_h, moved), (force_h, friction)):
        values[:, :, 1], values[:, :, 2] = amplitude.real, -amplitude.imag
    return balance.predict(motion_h, force_h)


def solve_static_state(joint: Joint, run: Run) -> State | Failure:
    """Static state with unilateral contact and friction, Eqs. (3), (4) and (8), under a load that rises from zero.

    joint: its excitation is left out. That of a ring whose contacts are equal begins from that of its sector, with the
    friction of this state: blades deviate after the joint is put together.
    Returns the state; STATIC_SLIDING or STATIC_OPEN where there is no static state, STATIC_FAILED where none is found.
    """
    sector = at_rest(joint)
    if sector is not None:
        found = solve_static_state(sector, run)
        return found if isinstance(found, Failure) else _in_all_sectors(joint, found, run)
    run, contact = run.fresh(), joint.contact
    # without gaps and given normal forces all states of a rising load are proportional
    n_steps = LOAD_STEPS if contact.gap.any() or not contact.has_normal.all() else 1
    unmoved = np.zeros((contact.n_contact, 3, 1))
    rest = Balance(static_joint(joint, 0.0), np.zeros((contact.n_contact, joint.law.n_history)))
    state = replace(state_of(rest.joint, rest.evaluate(rest.predict(unmoved, unmoved))), next_history=rest.history)
    for step in range(1, n_steps + 1):
        balance = Balance(static_joint(joint, step / n_steps), state.next_history)
        before = state.evaluation.predicted_h
        start = balance.joint.structure.force_h if step == 1 else before * (step / (step - 1.0))
        found = run.state(balance, start) or _settled(balance, state.evaluation, run)
        if isinstance(found, Failure):
            return found
        state = found
    return state


def _in_all_sectors(joint: Joint, sector: State, run: Run) -> State | Failure:
    """The static state of a ring, from that of its sector."""
    run, n_sectors = run.fresh(), joint.model.n_repeated
    balance = Balance(static_joint(joint, 1.0), everywhere(sector.next_history, n_sectors))
    start = everywhere(sector.evaluation.predicted_h, n_sectors)
    return run.state(balance, start) or _settled(balance, balance.evaluate(start), run)


def _settled(balance: Balance, before: Evaluation, run: Run) -> State | Failure:
    used, found = run.budget.iterations, _settle(balance, before, run)
    # every search needs a static state, whose steps have a limit of their own
    run.budget.most_iterations += run.budget.iterations - used
    return found


def _settle(balance: Balance, before: Evaluation, run: Run) -> State | Failure:
    """Static state to which viscous pairs come from the state `before`, or why there is none."""
    viscosity, begun = 1.0, before.displacement_h
    far, moved = float(balance.joint.contact.gap.max()), np.zeros_like(begun)
    for _ in range(SEARCH_ITERATIONS):
        viscous = replace(balance, joint=viscous_joint(balance.joint, viscosity, before.displacement_h))
        ahead = run.state(viscous, viscous.predict(before.displacement_h, before.force_h), most=NEAR_ITERATIONS)
        if ahead is None:
            viscosity /= SMALLEST_STEP_RATIO**2
            continue
        before = ahead.evaluation
        balance = replace(balance, history=ahead.next_history)
        end = run.state(balance, balance.predict(before.displacement_h, before.force_h), most=NEAR_ITERATIONS)
        if end is not None:
            return end
        if not moved.any():
            # the first step is about as long as the load deforms the joint
            far = max(far, RUNAWAY * float(np.abs(before.displacement_h - begun).max()))
        moved = before.displacement_h - begun
        if viscosity < NEGLIGIBLE and np.abs(moved).max() > far:
            break
        viscosity *= SMALLEST_STEP_RATIO
    if not np.abs(moved).max() > far:
        return Failure(Outcome.STATIC_FAILED, f"the pairs do not come to rest in {SEARCH_ITERATIONS} viscous steps")
    # a motion without end
    opened, slid = -moved[:, 0, 0], np.linalg.norm(moved[:, 1:, 0], axis=1)
    opens = opened.max() > slid.max()
    outcome, most = (Outcome.STATIC_OPEN, opened) if opens else (Outcome.STATIC_SLIDING, slid)
    return Failure(outcome, f"contact pair {int(most.argmax())} moves farthest")
