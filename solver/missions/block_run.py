"""One block, flown for one mission or for many at once: its wear, and the reference solution of its wear."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from solver.clock import computing_time
from solver.contact.wear_law import WearLaw
from solver.loading_history.sweep_start import Sweep
from solver.missions.block_start import begin_block
from solver.missions.blocks import Block, Mission, worn
from solver.model import ComplexArray, FloatArray
from solver.outcome import Outcome
from solver.packing import in_rows, packable
from solver.results.cut_off import first_cut_off
from solver.results.history import StartState
from solver.settings import SolverSettings
from solver.structure.joint import build_case
from solver.wear.solutions import Ended, Like, SlowTime, Solutions
from solver.wear.state import Failure


@packable
@dataclass(frozen=True)
class BlockRun:
    """A block that was flown for a number of missions at once.

    missions (n,): ascending numbers of missions, the first 0.
    growth (n, n_contact): wear depth since the start of the block at these numbers, m.
    response (n, n_response): complex first harmonic, m.
    peak (n, n_response): largest magnitude over a period, m.
    response_error (n,): estimated relative error of both.
    failure: reason of the end; the outcome CONVERGED for a regular end.
    start_rate (n_contact,): wear rate at the start, m per cycle.
    start_error: estimated relative error of this rate by harmonics, samples and the way to the start state.
    inaccurate: largest relative error of a state above rtol, 0 where there is none.
    held: whether the mean position of a joint that slides as a whole was held.
    cut_off: whether a pair at an edge of the modelled contact carries load or has worn.
    like: what the reference solution takes over.
    last: the state at the end, for a block that continues; its `start_history` is that of the next state.
    iterations: Newton iterations, start state included.
    begins_alike: whether each mission begins with the first response, as a passage does.
    sweep_rate: |df/dt| / (zeta f)^2 of a passage, see `solver.missions.passage`; 0 for steady vibration.
    """

    missions: tuple[int, ...]
    growth: FloatArray
    response: ComplexArray
    peak: FloatArray
    response_error: FloatArray
    failure: Failure
    start_rate: FloatArray
    start_error: float = 0.0
    inaccurate: float = 0.0
    held: bool = False
    cut_off: bool = False
    like: Like | None = None
    last: StartState | None = None
    iterations: int = 0
    begins_alike: bool = False
    sweep_rate: float = 0.0

    @property
    def completed(self) -> bool:
        """Whether the block was flown to its end."""
        return self.failure.outcome is Outcome.CONVERGED


@dataclass(frozen=True)
class BlockCase:
    """What a block is flown with.

    mission, place: the mission, and the place of the block in it.
    depth (n_contact,): m, worn before the block.
    carried: state that the block continues; None for a block that begins anew.
    missions: ascending numbers of missions at which the block is read, the first 0, the last the number flown.
    settings: with the time that is left.
    """

    mission: Mission
    place: int
    depth: FloatArray
    carried: StartState | None
    missions: tuple[int, ...]
    settings: SolverSettings

    @property
    def block(self) -> Block:
        """The block."""
        return self.mission.blocks[self.place]

    @property
    def counts(self) -> FloatArray:
        """Cycle counts (n,) of the block at which it is read."""
        return np.array(self.missions, np.float64) * self.block.steady[1]

    @property
    def law(self) -> WearLaw:
        """The wear law, whose table counts depths from the unworn joint."""
        law = self.mission.law
        return law if law.name != "table" else replace(law, worn=tuple(self.depth.tolist()))


def run_block(case: BlockCase, like: Like | None = None) -> BlockRun:
    """Fly a block, or its reference solution.

    A failure is a value. With `like`, of the same block in the history, the reference solution is integrated.
    """
    began, block = computing_time(), case.block
    sweep: Sweep = case.mission.first if block.begin == "continue" else block.begin
    start = begin_block(block, case.depth, sweep, case.carried, case.settings)
    if start.state is None:
        return not_flown(case, Failure(start.outcome, start.message), start.newton_iterations)
    left = replace(case.settings, time_limit=case.settings.time_limit - (computing_time() - began))
    model = worn(block.model, case.depth)
    asked = SlowTime(
        case.mission.wear_coefficient,
        "adaptive",
        case.counts,
        law=case.law,
        ends_at_last=case.mission.continued_by(case.place),
    )
    of_block = build_case(model, block.friction_coefficient, start.penalty_omega, left, start.resolution)
    solutions = Solutions(of_block, start, asked)
    if like is None:
        ended = solutions.history()
        output = solutions.output_of(ended)
    else:
        ended = solutions.follow(like, case.counts)
        output = solutions.output_of_reference(ended)
    iterations = start.newton_iterations + ended.iterations
    if ended.state is None or ended.failure.outcome is not Outcome.CONVERGED:
        return not_flown(case, ended.failure, iterations)
    return _read(case, ended, output.read(case.counts), start, iterations)


def _read(case: BlockCase, ended: Ended, values: dict[str, Any], start: StartState, iterations: int) -> BlockRun:
    """The result of a block that was flown to its end."""
    state, course = ended.state, ended.output.course
    assert state is not None
    contact, end = case.block.model.contact, float(case.counts[-1])
    cut = first_cut_off(contact, case.counts, values["mean_pressure"], values["wear_depth"])
    found = BlockRun(
        missions=case.missions,
        growth=values["wear_depth"],
        response=values["response"],
        peak=values["response_peak"],
        response_error=values["response_error"],
        failure=ended.failure,
        start_rate=values["depth_rate"][0],
        start_error=float(values["wear_rate_error"][0]),
        inaccurate=state.worst.largest if state.inaccurate_from <= end else 0.0,
        held=state.held_from <= end,
        cut_off=not math.isnan(cut),
        like=Like(course.resolutions, state.step_limit, ended.iterations),
        last=_last(case, ended, start) if case.mission.continued_by(case.place) else None,
        iterations=iterations,
    )
    # as read from a file: an interrupted mission goes on with equal bits
    return in_rows(found)


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


def not_flown(case: BlockCase, failure: Failure, iterations: int) -> BlockRun:
    """A block that was not flown to its end."""
    unknown = np.full((len(case.missions), case.depth.size), np.nan)
    response = np.full((len(case.missions), len(case.block.model.response_names)), np.nan)
    return BlockRun(
        case.missions, unknown, response.astype(complex), response, response[:, 0], failure, unknown[0],
        iterations=iterations,
    )  # fmt: skip
