"""The state with which a block begins: by its own way, as in a mission before, or from the block before."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.clock import computing_time
from solver.continuation.first_state import solve_first_state
from solver.continuation.natural import SMOOTH_CHANGE
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import State, final_history, vibration_change
from solver.loading_history.frequency_sweep import FrequencySweep
from solver.loading_history.path import LoadingPath
from solver.loading_history.start_states import follow_line
from solver.loading_history.sweep_start import Direction
from solver.missions.blocks import Block, worn
from solver.model import FloatArray
from solver.newton.run import Budget, Run
from solver.outcome import Outcome
from solver.packing import packable
from solver.results.history import PeriodicState, StartState
from solver.results.state_report import periodic_state
from solver.settings import Resolution, SolverSettings
from solver.stability.floquet import find_instability
from solver.structure.joint import Case, build_case

LARGEST_CHANGE = 2.0
"""Largest change between two nodes of an earlier sweep, over the largest change of a step of a sweep."""

CHANGE_OF_A_WAY = 0.5
"""Change of the vibration behind such a sweep, after which the sweep chooses its nodes anew and its error is estimated
again. A state without its way is left after `SMOOTH_CHANGE`, as only the way tells on which branch it lies."""

MOST_HALVINGS = 12
"""Most halvings of the distance of two such nodes in one sweep, to come past a corner at the resonance."""


@packable
@dataclass(frozen=True)
class Begun:
    """The state to which the ramp or the sweep of a block has led in an earlier mission, and the way.

    start: the state with its errors; None for a passage.
    nodes: frequencies, rad/s, or load factors of the sweep's nodes; of a passage the frequencies that count, Hz.
    resolution: harmonics and samples of the last node.
    """

    start: StartState | None
    nodes: tuple[float, ...]
    resolution: Resolution | None = None


def begin_block(
    line: FrequencySweep, frequency: float, begun: Begun | None, every_node: int
) -> tuple[StartState, Begun | None]:
    """The state to which the ramp or the sweep of a block leads at its depths, and what the next mission takes over.

    line: the ramp or sweep at the depths before the block. frequency: Hz.
    begun: of an earlier mission. every_node: 1, or the number of its nodes in a step of a reference solution.

    Raises
    ------
    OutOfTimeError
        The time is over.
    """
    if begun is not None and (again := _again(line, begun, every_node)) is not None:
        return again, begun
    _, start = next(follow_line(line, np.array([frequency])))
    nodes = line.nodes
    if start.state is None or nodes is None:
        return start, None
    passed = tuple(nodes.passed) if nodes.here is not None and start.branch == 0 else ()
    return start, Begun(start, passed, nodes.state.nodes.resolution)


def _again(line: FrequencySweep, begun: Begun, every_node: int) -> StartState | None:
    """The state at other depths than `begun`, with its errors, through the nodes of its sweep.

    With nodes of its own, the sweep of each mission would leave other static friction forces: the wear of a mission
    would jump from depth to depth by the error of the sweep. Where each pair slips or opens within the period, the
    state keeps nothing of its way, and follows from the depths alone. None where the way has jumped over a fold, where
    there is no stable state, or where the vibration has changed so much that the way may lead to another branch.
    """
    start, settings = begun.start, line.settings
    if start is None or start.state is None or start.branch > 0:
        return None
    run, state = Run(settings.tolerance, Budget(deadline=line.run.budget.deadline)), start.state
    case = build_case(line.model, line.friction_coefficient, start.penalty_omega, settings, start.resolution)
    ramp = line.sweep == "ramp"
    path = LoadingPath(case, line.excitation_amplitude, state.omega if ramp else None)
    target = 1.0 if ramp else state.omega
    balance = _balance(case, state)
    at = balance.evaluate(balance.predict(state.displacement_h, state.contact_force_h))
    before = State(at, state.start_history, target)
    try:
        found, most = path.solve((before,), target, run) if path.forgets(before) else None, SMOOTH_CHANGE
        if found is None or not path.forgets(found):
            found, most = _through_nodes(path, begun, target, every_node, run), CHANGE_OF_A_WAY
        if found is None or vibration_change(at, found.evaluation) > most:
            return None
        joint = path.joint_at(target)
        if find_instability(case, joint, found.evaluation, run, line.every):
            return None
    except np.linalg.LinAlgError:
        return None
    found_state = periodic_state(joint, found)
    return replace(start, state=found_state, reference=None, newton_iterations=run.budget.iterations)


def _through_nodes(path: LoadingPath, begun: Begun, target: float, every_node: int, run: Run) -> State | None:
    """The state at a target of the path, through the nodes of an earlier sweep; None where it is not found."""
    if not begun.nodes or begun.resolution is None:
        return None
    coarse, (first, *nodes) = path.at(begun.resolution), begun.nodes[::every_node]
    joint, unworn = coarse.joint_at(first), np.zeros(path.case.model.contact.n_contact)
    found: State | Outcome | None = solve_first_state(coarse.case, joint.omega, joint.excitation_amplitude, unworn, run)
    if not isinstance(found, State):
        return None
    states: tuple[State, ...] = (replace(found, parameter=first),)
    ahead, halvings = [*nodes, target], 0
    while ahead:
        here, parameter = states[-1], ahead[0]
        after = coarse.solve(states, parameter, run if parameter == target else run.to(coarse.node_tolerance))
        if after is not None and coarse.change(here, after, float(every_node)) <= LARGEST_CHANGE:
            states = (here, after)
            ahead.pop(0)
        elif (halvings := halvings + 1) > MOST_HALVINGS:
            return None
        else:
            ahead.insert(0, 0.5 * (here.parameter + parameter))
    return states[-1] if coarse.case is path.case else run.move(coarse.case, path.joint_at(target), states[-1])


def continue_block(block: Block, depth: FloatArray, carried: StartState, settings: SolverSettings) -> StartState:
    """The state of a block that keeps the tangential history of the block before, or the reason why there is none.

    depth (n_contact,): m, worn before the block. carried: state at the end of the block before. It is solved first at
    this depth, which a longer or an extrapolated step may have changed. Then amplitude and frequency change, one after
    the other, the frequency at the smaller of both amplitudes.

    Raises
    ------
    OutOfTimeError, numpy.linalg.LinAlgError
        The time is over; a structure is singular.
    """
    model, before = worn(block.model, depth), carried.state
    assert before is not None
    run = Run(settings.tolerance, Budget(deadline=computing_time() + settings.time_limit))
    case = build_case(model, block.friction_coefficient, carried.penalty_omega, settings, carried.resolution)
    balance = _balance(case, before)
    found = run.solve(balance, balance.predict(before.displacement_h, before.contact_force_h))
    if not found.converged:
        return replace(carried, state=None, outcome=Outcome.BRANCH_LOST, newton_iterations=run.budget.iterations)
    start = replace(carried, state=periodic_state(balance.joint, State(found.evaluation, before.start_history)))
    (frequency, _), amplitude = block.steady, block.excitation_amplitude
    along: Direction = "up" if 2.0 * np.pi * frequency > before.omega else "down"
    lower = min(amplitude, before.excitation_amplitude)
    legs: list[tuple[Direction, float, float]] = [(along, frequency, lower)]
    if amplitude > lower:
        legs.append(("ramp", frequency, amplitude))
    else:
        legs.insert(0, ("ramp", before.omega / (2.0 * np.pi), amplitude))
    iterations = run.budget.iterations
    for way, at, load in legs:
        if start.state is not None:
            line = FrequencySweep(model, block.friction_coefficient, load, way, settings)
            line.set_deadline(run.budget.deadline)
            start = _gone(line, at, start)
            iterations += line.n_iterations
    return replace(start, newton_iterations=iterations)


def _gone(line: FrequencySweep, frequency: float, start: StartState) -> StartState:
    """The state at another frequency, Hz, or another amplitude, if it is another one; or why there is none."""
    before, ramp, amplitude = start.state, line.sweep == "ramp", line.excitation_amplitude
    assert before is not None
    if before.excitation_amplitude == amplitude if ramp else before.omega == 2.0 * np.pi * frequency:
        return start
    case = build_case(line.model, line.friction_coefficient, start.penalty_omega, line.settings, start.resolution)
    balance = _balance(case, before)
    at = balance.evaluate(balance.predict(before.displacement_h, before.contact_force_h))
    parameter = before.excitation_amplitude / amplitude if ramp else before.omega
    if line.go_on_from(case, State(at, final_history(balance, at), parameter), frequency):
        found = line.advance(frequency)
    else:
        found = line.without_state(Outcome.UNSETTLED)
    return replace(found, newton_iterations=0, branch=start.branch + found.branch)


def _balance(case: Case, state: PeriodicState) -> Balance:
    """The balance of a state of the joint of a case, whose gaps hold the wear."""
    joint = case.joint(state.omega, state.excitation_amplitude)
    return Balance(joint, state.start_history, np.zeros_like(state.wear_depth))
