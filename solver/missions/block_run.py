"""One block of one mission: the state with which it begins, its wear, and the reference solution of its wear."""

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg

from solver.accuracy.refinement import DIFFERENCE_SAFETY
from solver.clock import computing_time
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import Failure
from solver.loading_history.given_nodes import EarlierSweep
from solver.loading_history.path import LoadingPath
from solver.loading_history.start_states import FrequencySweep
from solver.loading_history.sweep import STEPS_OF_REFERENCE
from solver.missions.mission import Block, MissionRequest
from solver.model import ComplexArray, FloatArray, ReducedModel
from solver.newton.run import Budget, Run
from solver.outcome import Outcome
from solver.results.history import StartState, first_cut_off
from solver.results.state_report import evaluated, periodic_state
from solver.settings import Direction, Passage, Resolution
from solver.structure.joint import Case, build_case
from solver.wear.problem import WearProblem, reference_of
from solver.wear.slow_time import Guide, Integrator
from solver.wear.step import rate_slope
from solver.wear.wearing_joint import WearingJoint, WearRequest, WearState

Earlier = EarlierSweep | tuple[float, ...] | None
"""What a block of the mission before leaves: its sweep, or the frequencies of a passage that count, Hz; None for one
that continues.
"""


@dataclass(frozen=True)
class BlockResult:
    """A block that was computed once.

    growth, dissipated (n_contact,): depth worn in the block, m, energy that its friction dissipates, J/m2.
    response, response_peak (2, n_response): complex first harmonic and largest magnitude at start and end, m.
    slope (n_contact, n_contact): derivative of the growth by the depth before, 1; None if not asked for.
    response_error, growth_error: estimated relative errors.
    inaccurate: largest relative error of a state above rtol, 0 where there is none, inf where stability is not known.
    held, cut_off: whether a joint that slides as a whole was held, or a pair at an edge of the contact carries load.
    guide, sweep: what the reference solution takes over, and the next mission.
    last: the state at the end, which a block that continues solves again; `start_history` is that which it leaves.
    iterations: of Newton's method, start state included.
    sweep_rate: |df/dt| / (zeta f)^2 of a passage; 0 for steady vibration.
    """

    growth: FloatArray
    dissipated: FloatArray
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
    sweep: Earlier = None
    iterations: int = 0
    sweep_rate: float = 0.0


@dataclass(frozen=True)
class BlockInput:
    """What a block is computed with.

    mission, block: the mission, and the block of it. worn (2, n_contact): depth, m, and dissipated energy, J/m2, before
        the block.
    deadline: CPU time of the thread, s, at which the time of the history is over.
    before: last state of the block before, which the block continues; None for a block with a sweep of its own.
    earlier, guide: of this block in an earlier mission, and in the history for its reference solution; else None.
    with_slope: whether the slope of the growth is asked for.
    with_switching: whether stability is tested at start and end, also where nothing speaks for a loss of stability.
    """

    mission: MissionRequest
    block: Block
    worn: FloatArray
    deadline: float = math.inf
    before: StartState | None = None
    earlier: Earlier = None
    guide: Guide | None = None
    with_slope: bool = False
    with_switching: bool = True

    @property
    def depth(self) -> FloatArray:
        """Depth worn before the block (n_contact,), m."""
        return np.asarray(self.worn[0])

    @property
    def passage(self) -> Passage:
        """The passage of a block that is one."""
        assert isinstance(self.block.frequency, Passage)
        return self.block.frequency

    @property
    def model(self) -> ReducedModel:
        """The model whose pairs the depth has opened, and whose contact the energy has changed."""
        contact = self.block.model.contact.after(self.worn[1])
        return replace(self.block.model, contact=replace(contact, gap=contact.gap + self.depth))

    @property
    def request(self) -> WearRequest:
        """The wear history of the block, with the wear law from the depth before on."""
        counts, law = np.array([0.0, self.block.cycles or 0.0]), self.mission.law.begun_at(self.depth)
        return WearRequest(self.mission.wear_coefficient, None, counts, law=law, ends_at_last=True)

    def sweeps(
        self, direction: Direction, amplitude: float, known: tuple[tuple[float, Resolution], ...] = ()
    ) -> FrequencySweep:
        """A sweep at the depth before the block. amplitude: N. known: as in `FrequencySweep`."""
        settings = replace(self.mission.settings, time_limit=self.deadline - computing_time())
        asked = self.model, amplitude, direction, settings
        sweeps = FrequencySweep(*asked, with_switching=self.with_switching, known=known)
        sweeps.set_deadline(self.deadline)
        return sweeps

    def case_of(self, start: StartState) -> Case:
        """The case at the depth before the block, with harmonics, samples and penalty of a state."""
        return build_case(self.model, start.penalty_omega, self.mission.settings.of_steps, start.resolution)

    def wearing_joint(self, start: StartState) -> tuple[WearingJoint, WearState]:
        """The joint at the depth before the block, and a state of it."""
        wearing = WearingJoint(self.case_of(start), start, self.request)
        return wearing, wearing.unworn_state()


def run_block(given: BlockInput) -> BlockResult | Failure:
    """Compute a block of steady vibration, or why it does not come to its end. Raises as `guarded`."""
    start, sweep = find_start(given)
    if start.state is None:
        return Failure(start.outcome, start.message)
    case, request = given.case_of(start), given.request
    counts = np.array([0.0, request.end])
    if given.guide is None:
        problem = WearProblem(case, start, request, stable_end=given.with_switching)
    else:
        problem = reference_of(case, start, request, given.guide, counts)
    solution = Integrator(given.deadline - computing_time()).integrate(problem)
    failure = solution.failure
    if failure is not None and not failure.outcome.complete:
        return failure
    state, values, slope = solution.state, solution.course.read(counts), None
    depth, worst, checked = values["wear_depth"], state.record.worst, state.checked
    volume = float(depth[-1] @ given.mission.area)
    if given.with_slope:
        # the flow of the linearised wear rate
        rates = rate_slope(problem, state, given.depth + depth[-1] > 0.0)
        slope = np.asarray(scipy.linalg.expm(counts[-1] * rates) - np.eye(len(rates)))
    # the errors of the first steps of the blocks have one sign and add up over the missions
    by_steps = DIFFERENCE_SAFETY * float(values["local"][-1]) / volume if volume > 0.0 else 0.0
    motion, force, history = state.at.displacement_h, state.at.force_h, state.point.next_history
    return BlockResult(
        growth=depth[-1],
        dissipated=values["dissipated_energy"][-1],
        response=values["response"],
        response_peak=values["response_peak"],
        slope=slope,
        response_error=float(values["response_error"].max()),
        growth_error=float(values["wear_rate_error"][0]) + by_steps,
        inaccurate=math.inf if failure else worst.largest if state.record.inaccurate_from <= counts[-1] else 0.0,
        held=state.record.held_from <= counts[-1],
        cut_off=not math.isnan(first_cut_off(case.model.contact, counts, values["mean_pressure"], depth)),
        guide=state.guide,
        last=replace(
            start,
            outcome=Outcome.CONVERGED if checked.accurate else Outcome.INACCURATE,
            state=replace(start.state, displacement_h=motion, contact_force_h=force, start_history=history),
            resolution=state.point.resolution,
            response_error=checked.estimate.response,
            wear_rate_error=checked.estimate.wear_rate,
            by_resolution=checked.estimate,
            reference=None,
        ),
        sweep=sweep,
        iterations=start.newton_iterations + solution.iterations,
    )


def find_start(given: BlockInput) -> tuple[StartState, EarlierSweep | None]:
    """The state with which a block begins, or why there is none; and what the block of the next mission takes over."""
    block, earlier = given.block, given.earlier
    run = Run(given.mission.settings.tolerance, Budget(deadline=given.deadline))
    if given.before is not None:
        return _continued(given, given.before, run), None
    if isinstance(earlier, EarlierSweep):
        omega = 2.0 * np.pi * block.ends[0] if block.way == "ramp" else None
        path = LoadingPath(given.case_of(earlier.start), block.excitation_amplitude, omega)
        stride = 1 if given.guide is None else STEPS_OF_REFERENCE
        again = earlier.again(path, run, stride, with_switching=given.with_switching)
        if again is not None:
            return again, earlier
    direction = given.mission.first_sweep if block.way == "continue" else block.way
    sweeps = given.sweeps(direction, block.excitation_amplitude)
    _, start = next(sweeps.states(np.array([block.ends[0]])))
    present = sweeps.present
    if start.state is None or present is None or block.way == "continue":
        return start, None
    passed = () if present.here is None else tuple(present.passed)
    return start, EarlierSweep(passed, start, present.path.case.resolution)


def _continued(given: BlockInput, last: StartState, run: Run) -> StartState:
    """The state of a block that keeps the tangential history of the block before, or why there is none.

    last: state at the end of the block before, solved first at the depth before the block. Then amplitude and
    frequency change, one after the other, the frequency at the smaller amplitude. Raises as `guarded`.
    """
    before = last.state
    assert before is not None
    case = given.case_of(last)
    state = evaluated(case, before)
    found = run.state(Balance(state.joint(case), before.start_history), state.evaluation.predicted_h)
    if found is None:
        said = "the last state of the block before is not found at the depth before this block"
        return replace(last, state=None, outcome=Outcome.BRANCH_LOST, message=said)
    start = replace(last, state=periodic_state(found), newton_iterations=run.budget.iterations)
    frequency, amplitude = given.block.ends[0], given.block.excitation_amplitude
    along: Direction = "up" if 2.0 * np.pi * frequency > before.omega else "down"
    lower = min(amplitude, before.excitation_amplitude)
    legs: tuple[tuple[Direction, float, float], ...] = (
        ("ramp", before.omega / (2.0 * np.pi), lower),
        (along, frequency, lower),
        ("ramp", frequency, amplitude),
    )
    for direction, target, load in legs:
        if start.state is not None:
            start = given.sweeps(direction, load).go_on(start, given.case_of(start), target)
    return start
