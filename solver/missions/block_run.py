"""One block of one mission: its wear, and the reference solution of its wear."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.linalg

from solver.accuracy.options import ACCURACY
from solver.clock import computing_time
from solver.contact.wear_law import WearLaw
from solver.harmonic_balance.state import Failure
from solver.loading_history.frequency_sweep import FrequencySweep
from solver.loading_history.sweep_start import Direction
from solver.missions.block_start import Begun, begin_block, continue_block
from solver.missions.blocks import Block, Mission, worn
from solver.model import ComplexArray, FloatArray
from solver.outcome import Outcome
from solver.packing import in_rows, packable
from solver.results.cut_off import first_cut_off
from solver.results.history import StartState
from solver.settings import SolverSettings
from solver.structure.joint import build_case
from solver.wear.control import Adaptive
from solver.wear.integrate import Ended
from solver.wear.rate_slope import rate_slope
from solver.wear.solutions import Like, SlowTime, Solutions
from solver.wear.wearing_joint import WearingJoint

NODES_OF_A_REFERENCE_STEP = 3
"""Nodes of the sweep of a block in one step of its reference solution: the difference of both is twice the error by the
steps of the sweep, as in a wear history."""


@packable
@dataclass(frozen=True)
class BlockRun:
    """A block that was computed once. Rows of the responses: begin and end.

    failure: reason of the end; the outcome CONVERGED for a regular end.
    growth (n_contact,): depth worn in the block, m.
    response (2, n_response): complex first harmonic, m.
    peak (2, n_response): largest magnitude over a period, m.
    slope (n_contact, n_contact): derivative of the growth with respect to the depth before, 1; None if not asked for.
    response_error: estimated relative error of response and peak.
    growth_error: estimated relative error of the growth by harmonics, samples, the way to the start state and steps.
    inaccurate: largest relative error of a state above rtol, 0 where there is none.
    held: whether the mean position of a joint that slides as a whole was held.
    cut_off: whether a pair at an edge of the modelled contact carries load or has worn.
    like: what the reference solution takes over.
    last: the state at the end, for a block that continues; its `start_history` is that of the next state.
    begun: what the block of the next mission takes over; None for a block that continues.
    iterations: Newton iterations, start state included.
    sweep_rate: |df/dt| / (zeta f)^2 of a passage, see `solver.missions.passage`; 0 for steady vibration.
    """

    failure: Failure
    growth: FloatArray
    response: ComplexArray
    peak: FloatArray
    slope: FloatArray | None = None
    response_error: float = 0.0
    growth_error: float = 0.0
    inaccurate: float = 0.0
    held: bool = False
    cut_off: bool = False
    like: Like | None = None
    last: StartState | None = None
    begun: Begun | None = None
    iterations: int = 0
    sweep_rate: float = 0.0

    @property
    def completed(self) -> bool:
        """Whether the block was computed to its end."""
        return self.failure.outcome is Outcome.CONVERGED


@dataclass(frozen=True)
class BlockCase:
    """What a block is computed with.

    mission, place: the mission, and the place of the block in it.
    depth (n_contact,): m, worn before the block.
    carried: state that the block continues; None for a block that begins anew.
    settings: with the time that is left.
    with_slope: whether the slope of the growth is asked for.
    begun: of an earlier mission.
    every: whether stability is tested at begin and end, also where nothing speaks for a loss of stability.
    """

    mission: Mission
    place: int
    depth: FloatArray
    carried: StartState | None
    settings: SolverSettings
    with_slope: bool = False
    begun: Begun | None = None
    every: bool = True

    @property
    def block(self) -> Block:
        """The block."""
        return self.mission.blocks[self.place]

    @property
    def law(self) -> WearLaw:
        """The wear law, whose table counts depths from the unworn joint."""
        return self.mission.law.begun_at(self.depth)

    def line(self, sweep: Direction) -> FrequencySweep:
        """The sweep to the states of the block, at the depth before."""
        block = self.block
        model = worn(block.model, self.depth)
        line = FrequencySweep(model, block.friction_coefficient, block.excitation_amplitude, sweep, self.settings)
        line.every = self.every
        return line

    def not_computed(self, failure: Failure, iterations: int = 0) -> BlockRun:
        """The block, which was not computed to its end."""
        nothing = np.full((2, len(self.block.model.response_names)), np.nan)
        unknown = np.full_like(self.depth, np.nan)
        return BlockRun(failure, unknown, nothing.astype(complex), nothing, iterations=iterations)


def run_block(case: BlockCase, like: Like | None = None) -> BlockRun:
    """Compute a block of steady vibration; with `like` of this block in the history its reference solution.

    A block that does not come to its end has its failure as a value. Raises OutOfTimeError, LinAlgError.
    """
    began, block = computing_time(), case.block
    frequency, cycles = block.steady
    if case.carried is not None:
        start, begun = continue_block(block, case.depth, case.carried, case.settings), None
    else:
        line = case.line(case.mission.first if block.way == "continue" else block.way)
        line.set_deadline(began + case.settings.time_limit)
        every_node = 1 if like is None else NODES_OF_A_REFERENCE_STEP
        start, begun = begin_block(line, frequency, case.begun, every_node)
        begun = None if block.way == "continue" else begun
    if start.state is None:
        return case.not_computed(Failure(start.outcome, start.message), start.newton_iterations)
    left = replace(case.settings, time_limit=case.settings.time_limit - (computing_time() - began))
    counts = np.array([0.0, cycles])
    asked = SlowTime(case.mission.wear_coefficient, Adaptive(left.rtol), counts, law=case.law, ends_at_last=True)
    model = worn(block.model, case.depth)
    of_block = build_case(model, block.friction_coefficient, start.penalty_omega, left, start.resolution)
    solutions = Solutions(of_block, start, asked)
    ended = solutions.history(stable_end=case.every) if like is None else solutions.follow(like, counts)
    iterations = start.newton_iterations + ended.iterations
    if ended.state is None or ended.failure.outcome is not Outcome.CONVERGED:
        return case.not_computed(ended.failure, iterations)
    computed = replace(_read(case, ended, ended.course.read(counts), start), begun=begun, iterations=iterations)
    if case.with_slope:
        work = WearingJoint(of_block, start, asked.wear_coefficient, asked.law)
        computed = replace(computed, slope=_slope(work, ended, case, computed.growth))
    # as read from a file: an interrupted mission goes on with equal bits
    return in_rows(computed)


def _slope(work: WearingJoint, ended: Ended, case: BlockCase, growth: FloatArray) -> FloatArray:
    """Derivative of the growth over the block: the flow of the linearised wear rate."""
    assert ended.state is not None
    at = ended.state.point.evaluation
    pairs = case.depth + growth > 0.0
    slope = rate_slope(work.at(ended.state), at, work.gain(1.0), work.wearing, pairs, work.run)
    return np.asarray(scipy.linalg.expm(case.block.steady[1] * slope) - np.eye(len(slope)))


def _read(case: BlockCase, ended: Ended, values: dict[str, Any], start: StartState) -> BlockRun:
    """The result of a block that was computed to its end."""
    state, course, end = ended.state, ended.course, case.block.steady[1]
    assert state is not None
    growth = values["wear_depth"][-1]
    volume = float(growth @ case.mission.area)
    # the errors of the first steps of the blocks have one sign and add up over the missions
    by_steps = ACCURACY.history_safety * float(values["local"][-1]) / volume if volume > 0.0 else 0.0
    cut = first_cut_off(case.block.model.contact, np.array([0.0, end]), values["mean_pressure"], values["wear_depth"])
    return BlockRun(
        failure=ended.failure,
        growth=growth,
        response=values["response"],
        peak=values["response_peak"],
        response_error=float(np.fmax.reduce(values["response_error"])),
        growth_error=float(values["wear_rate_error"][0]) + by_steps,
        inaccurate=state.worst.largest if state.inaccurate_from <= end else 0.0,
        held=state.held_from <= end,
        cut_off=not math.isnan(cut),
        like=Like(course.resolutions, state.step_limit, ended.iterations),
        last=_last(case, ended, start) if case.mission.continued_by(case.place) else None,
    )


def _last(case: BlockCase, ended: Ended, start: StartState) -> StartState:
    """The last state of a block, with the tangential history for the next one."""
    assert ended.state is not None
    assert start.state is not None
    point, choice = ended.state.point, ended.state.choice
    state = replace(
        start.state,
        displacement_h=point.evaluation.displacement_h,
        contact_force_h=point.evaluation.force_h,
        start_history=point.history,
        wear_depth=np.zeros_like(case.depth),
    )
    return replace(
        start,
        outcome=Outcome.CONVERGED if choice.accurate else Outcome.INACCURATE,
        state=state,
        resolution=ended.state.resolution,
        response_error=choice.estimate.response,
        wear_rate_error=choice.estimate.wear_rate,
        message="",
        reference=None,
    )
