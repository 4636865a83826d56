"""One block of one mission: the state with which it begins, its wear, and the reference solution of its wear."""

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from solver.accuracy.refinement import DIFFERENCE_SAFETY, VIBRATION_RECHECK
from solver.clock import computing_time
from solver.continuation.first_state import solve_first_state
from solver.continuation.natural import ATTEMPTS, SMOOTH_CHANGE
from solver.harmonic_balance.state import Failure, State, vibration_change
from solver.loading_history.path import LoadingPath
from solver.loading_history.start_states import FrequencySweep
from solver.loading_history.sweep import LAST_NODES, STEPS_OF_REFERENCE
from solver.missions.mission import Block, MissionRequest
from solver.model import ComplexArray, FloatArray, ReducedModel
from solver.newton.run import Budget, Run
from solver.outcome import Outcome, describe_inaccurate
from solver.packing import packable
from solver.results.history import StartState, first_cut_off
from solver.results.state_report import periodic_state
from solver.settings import Direction, Passage, Resolution
from solver.stability.floquet import find_instability
from solver.structure.condensation import SingularStructureError
from solver.structure.joint import Case, build_case
from solver.wear.problem import WearProblem, reference_of
from solver.wear.slow_time import Guide, Integrator
from solver.wear.step import rate_slope
from solver.wear.wearing_joint import WearingJoint, WearRequest, WearState

LARGEST_CHANGE = 2.0
"""Largest change between two nodes of an earlier sweep, over the largest change of a step of a sweep. With 1 missions
of the slider are equal, and of the dovetail within 9e-4."""


@packable
@dataclass(frozen=True)
class EarlierSweep:
    """The sweep with which a block began in an earlier mission.

    nodes: frequencies, rad/s, or load factors of its nodes, none if lost; of a passage the frequencies that count, Hz.
    start, resolution: state at its end, and harmonics and samples of the last node; None for a passage.
    """

    nodes: tuple[float, ...]
    start: StartState | None = None
    resolution: Resolution | None = None


@dataclass(frozen=True)
class BlockResult:
    """A block that was computed once.

    growth (n_contact,): depth worn in the block, m.
    response, response_peak (2, n_response): complex first harmonic and largest magnitude at start and end, m.
    slope (n_contact, n_contact): derivative of the growth by the depth before, 1; None if not asked for.
    response_error, growth_error: estimated relative errors.
    inaccurate: largest relative error of a state above rtol, 0 where there is none, inf where stability is not known.
    held, cut_off: whether a joint that slides as a whole was held, or a pair at an edge of the contact carries load.
    guide, sweep: what the reference solution takes over, and the next mission (None for a block that continues).
    last: the state at the end, for a block that continues; its `start_history` is that of the next state.
    iterations: of Newton's method, start state included.
    sweep_rate: |df/dt| / (zeta f)^2 of a passage; 0 for steady vibration.
    """

    growth: FloatArray
    response: ComplexArray
    response_peak: FloatArray
    slope: FloatArray | None = None
    response_error: float = 0.0
    growth_error: float = 0.0
    inaccurate: float = 0.0
    held: bool = False
    cut_off: bool = False
    guide: Guide | None = None
    last: StartState | None = None
    sweep: EarlierSweep | None = None
    iterations: int = 0
    sweep_rate: float = 0.0


@dataclass(frozen=True)
class BlockInput:
    """What a block is computed with.

    mission, place: the mission, and the place of the block in it. depth (n_contact,): m, worn before the block.
    deadline: CPU time of the thread, s, at which the time of the history is over.
    before: last state of the block before, which the block continues; None for a block with a sweep of its own.
    earlier, guide: of this block in an earlier mission, and in the history for its reference solution; else None.
    with_slope: whether the slope of the growth is asked for.
    with_switching: whether stability is tested at start and end, also where nothing speaks for a loss of stability.
    """

    mission: MissionRequest
    place: int
    depth: FloatArray
    deadline: float = math.inf
    before: StartState | None = None
    earlier: EarlierSweep | None = None
    guide: Guide | None = None
    with_slope: bool = False
    with_switching: bool = True

    @property
    def block(self) -> Block:
        """The block."""
        return self.mission.blocks[self.place]

    @property
    def passage(self) -> Passage:
        """The passage of a block that is one."""
        assert isinstance(self.block.frequency, Passage)
        return self.block.frequency

    @property
    def is_continued(self) -> bool:
        """Whether the next block begins from the last state of this one."""
        blocks = self.mission.blocks
        return blocks[(self.place + 1) % len(blocks)].way == "continue"

    @property
    def model(self) -> ReducedModel:
        """The model whose pairs the depth has opened."""
        contact = self.block.model.contact
        return replace(self.block.model, contact=replace(contact, gap=contact.gap + self.depth))

    @property
    def counts(self) -> FloatArray:
        """Cycle counts (2,) at start and end of a block of steady vibration."""
        return np.array([0.0, self.block.cycles or 0.0])

    @property
    def request(self) -> WearRequest:
        """The wear history of the block, with the wear law from the depth before on."""
        mission, law = self.mission, self.mission.law.begun_at(self.depth)
        return WearRequest(mission.wear_coefficient, None, self.counts, law=law, ends_at_last=True)

    def sweeps(self, direction: Direction, amplitude: float) -> FrequencySweep:
        """A sweep at the depth before the block. amplitude: N."""
        settings = replace(self.mission.settings, time_limit=self.deadline - computing_time())
        sweeps = FrequencySweep(self.model, self.block.friction_coefficient, amplitude, direction, settings)
        sweeps.with_switching = self.with_switching
        sweeps.set_deadline(self.deadline)
        return sweeps

    def case_of(self, start: StartState) -> Case:
        """The case at the depth before the block, with harmonics, samples and penalty of a state."""
        friction = self.block.friction_coefficient
        return build_case(self.model, friction, start.penalty_omega, self.mission.settings, start.resolution)

    def wearing_joint(self, start: StartState) -> tuple[WearingJoint, WearState]:
        """The joint at the depth before the block, and a state of it."""
        wearing = WearingJoint(self.case_of(start), start, self.request)
        return wearing, wearing.unworn_state()


def run_block(given: BlockInput) -> BlockResult | Failure:
    """Compute a block of steady vibration, or why it does not come to its end. Raises as `guarded`."""
    start, sweep = find_start(given)
    if start.state is None:
        return Failure(start.outcome, start.message)
    case, counts = given.case_of(start), given.counts
    if given.guide is None:
        problem = WearProblem(case, start, given.request, stable_end=given.with_switching)
    else:
        problem = reference_of(case, start, given.request, given.guide, counts)
    solution = Integrator(given.deadline - computing_time()).integrate(problem)
    failure = solution.failure
    if failure is not None and not failure.outcome.complete:
        return failure
    state, values, slope = solution.state, solution.course.read(counts), None
    depth = values["wear_depth"]
    volume = float(depth[-1] @ given.mission.area)
    if given.with_slope:
        # the flow of the linearised wear rate
        rates = rate_slope(problem, state, given.depth + depth[-1] > 0.0)
        slope = np.asarray(scipy.linalg.expm(counts[-1] * rates) - np.eye(len(rates)))
    # the errors of the first steps of the blocks have one sign and add up over the missions
    by_steps = DIFFERENCE_SAFETY * float(values["local"][-1]) / volume if volume > 0.0 else 0.0
    return BlockResult(
        growth=depth[-1],
        response=values["response"],
        response_peak=values["response_peak"],
        slope=slope,
        response_error=float(values["response_error"].max()),
        growth_error=float(values["wear_rate_error"][0]) + by_steps,
        inaccurate=math.inf if failure else state.worst.largest if state.inaccurate_from <= counts[-1] else 0.0,
        held=state.held_from <= counts[-1],
        cut_off=not math.isnan(first_cut_off(given.model.contact, counts, values["mean_pressure"], depth)),
        guide=Guide(state.resolutions, state.first_length),
        last=_last(state, start, given.mission.settings.rtol) if given.is_continued else None,
        sweep=sweep,
        iterations=start.newton_iterations + solution.iterations,
    )


def _last(state: WearState, start: StartState, rtol: float) -> StartState:
    """The last state of a block, with the tangential history for the next one."""
    at, known = state.at, state.estimate
    assert start.state is not None
    motion, force, history = at.displacement_h, at.force_h, state.point.history
    return replace(
        start,
        outcome=Outcome.CONVERGED if state.accurate else Outcome.INACCURATE,
        state=replace(start.state, displacement_h=motion, contact_force_h=force, start_history=history),
        resolution=state.resolution,
        response_error=known.response,
        wear_rate_error=known.wear_rate,
        message="" if state.accurate else describe_inaccurate(known.response, known.wear_rate, rtol),
        reference=None,
    )


def find_start(given: BlockInput) -> tuple[StartState, EarlierSweep | None]:
    """The state with which a block begins, or why there is none; and what the block of the next mission takes over."""
    block = given.block
    if given.before is not None:
        return _continued(given, given.before), None
    if given.earlier is not None and (again := _by_earlier_sweep(given, given.earlier)) is not None:
        return again, given.earlier
    direction = given.mission.first if block.way == "continue" else block.way
    sweeps = given.sweeps(direction, block.excitation_amplitude)
    _, start = next(sweeps.states(np.array([block.ends[0]])))
    present = sweeps.present
    if start.state is None or present is None or block.way == "continue":
        return start, None
    passed = () if present.here is None else tuple(present.passed)
    return start, EarlierSweep(passed, start, present.path.case.resolution)


def _by_earlier_sweep(given: BlockInput, earlier: EarlierSweep) -> StartState | None:
    """The state through the nodes of an earlier sweep, at other depths, with its errors; else None: where the sweep has
    jumped over a fold, there is no stable state, or the sweep may lead to another branch.

    With other nodes in each mission, the wear of a mission would jump from depth to depth by the error of the sweep.
    Above `VIBRATION_RECHECK` of the vibration with which nodes, harmonics and errors were chosen, a new sweep chooses
    them. Where each pair slips or opens within the period, the state follows from the depths alone; without a sweep,
    which alone says on which branch a state lies, the limit is `SMOOTH_CHANGE`.
    """
    start, run = earlier.start, Run(given.mission.settings.tolerance, Budget(deadline=given.deadline))
    if start is None or start.state is None or start.branch > 0:
        return None
    ramp, omega, (wearing, unworn) = given.block.way == "ramp", start.state.omega, given.wearing_joint(start)
    path = LoadingPath(wearing.case, given.block.excitation_amplitude, omega if ramp else None)
    target = 1.0 if ramp else omega
    before = State(unworn.at, start.state.start_history, target)
    try:
        state, most = path.solve((before,), target, run) if path.forgets(before) else None, SMOOTH_CHANGE
        if state is None or not path.forgets(state):
            stride = 1 if given.guide is None else STEPS_OF_REFERENCE
            state, most = _through_nodes(path, earlier, target, stride, run.fresh()), VIBRATION_RECHECK
        if state is None or vibration_change(unworn.at, state.evaluation) > most:
            return None
        joint = path.joint_at(target)
        if find_instability(wearing.case, joint, state.evaluation, run, given.with_switching):
            return None
    except SingularStructureError:
        return None
    return replace(start, state=periodic_state(joint, state), reference=None, newton_iterations=run.budget.iterations)


def _through_nodes(path: LoadingPath, earlier: EarlierSweep, target: float, stride: int, run: Run) -> State | None:
    """The state at a target of the path, through nodes of an earlier sweep; None where it is not found."""
    if not earlier.nodes or earlier.resolution is None:
        return None
    coarse, (first, *nodes) = path.at(earlier.resolution), earlier.nodes[::stride]
    joint = coarse.joint_at(first)
    begin = solve_first_state(coarse.case, joint.omega, joint.excitation_amplitude, run)
    if not isinstance(begin, State):
        return None
    states: tuple[State, ...] = (replace(begin, parameter=first),)
    ahead, halvings, rough = [*nodes, target], 0, run.with_tolerance(coarse.case.settings.rough_tolerance)
    while ahead:
        after = coarse.solve(states, ahead[0], run if ahead[0] == target else rough)
        if after is not None and coarse.change(states[-1], after) <= LARGEST_CHANGE * stride:
            states = (*states, after)[-LAST_NODES:]
            ahead.pop(0)
        elif (halvings := halvings + 1) > ATTEMPTS:
            return None
        else:
            # past a corner at the resonance: without, half of the sweeps up to 212.6 Hz of the dovetail begin anew
            ahead.insert(0, 0.5 * (states[-1].parameter + ahead[0]))
    return states[-1] if coarse.case is path.case else run.move(coarse.case, path.joint_at(target), states[-1])


def _continued(given: BlockInput, before: StartState) -> StartState:
    """The state of a block that keeps the tangential history of the block before, or why there is none.

    before: state at the end of the block before, solved first at the depth before the block. Then amplitude and
    frequency change, one after the other, the frequency at the smaller amplitude. Raises as `guarded`.
    """
    last, run = before.state, Run(given.mission.settings.tolerance, Budget(deadline=given.deadline))
    assert last is not None
    frequency, amplitude = given.block.ends[0], given.block.excitation_amplitude
    wearing, unworn = given.wearing_joint(before)
    balance = wearing.balance_of(unworn)
    state = run.state(balance, unworn.at.predicted_h)
    if state is None:
        said = "the last state of the block before is not found at the depth before this block"
        return replace(before, state=None, outcome=Outcome.BRANCH_LOST, message=said)
    start = replace(before, state=periodic_state(balance.joint, State(state.evaluation, last.start_history)))
    along: Direction = "up" if 2.0 * np.pi * frequency > last.omega else "down"
    iterations, lower = run.budget.iterations, min(amplitude, last.excitation_amplitude)
    legs: tuple[tuple[Direction, float, float], ...] = (
        ("ramp", last.omega / (2.0 * np.pi), lower),
        (along, frequency, lower),
        ("ramp", frequency, amplitude),
    )
    for direction, target, load in legs:
        here = start.state
        if here is None:
            break
        if here.excitation_amplitude == load if direction == "ramp" else here.omega == 2.0 * np.pi * target:
            continue
        sweeps, (wearing, unworn) = given.sweeps(direction, load), given.wearing_joint(start)
        parameter = here.excitation_amplitude / load if direction == "ramp" else here.omega
        if not sweeps.go_on_from(wearing.case, replace(unworn.point, parameter=parameter), target):
            said = "more harmonics change the last state of the block before by more than half"
            return replace(start, state=None, outcome=Outcome.UNSETTLED, message=said)
        _, after = next(sweeps.states(np.array([target])))
        start = replace(after, penalty_omega=start.penalty_omega, branch=start.branch + after.branch)
        iterations += after.newton_iterations
    return replace(start, newton_iterations=iterations)
