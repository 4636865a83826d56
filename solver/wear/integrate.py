"""A wear history and its reference solution as problems over the slow time.

The reference solution is a second computation whose difference, pair by pair, is taken for the error. It starts from
another sweep, with a third of the nodes (`solver.loading_history`), and is coarser in all: twice the tolerance of the
steps, the next lower harmonics and samples. Where pairs stick again, a resonance passes or a branch ends, errors grow,
and this difference with them; a sum of local errors does not.

A history with given Euler steps is compared with the adaptive history, which all given steps share. A coarser history
with the same steps errs as they do: where a pair only just slips (dovetail, 16 pairs, 212.5 Hz) it sticks with implicit
steps, 1.89 mm3, with steps of 250 cycles 1.90; the truth is 2.03.
"""

from __future__ import annotations

import math
from dataclasses import astuple, dataclass, replace
from functools import cached_property

import numpy as np

from solver.accuracy.resolved_state import fewer, shifted
from solver.contact.wear_law import ARCHARD, WearLaw
from solver.continuation.natural import NEAR_ITERATIONS
from solver.harmonic_balance.dlft import Balance
from solver.harmonic_balance.state import Failure
from solver.model import FloatArray, ReducedModel
from solver.newton.run import Budget
from solver.outcome import Outcome
from solver.packing import in_rows
from solver.results.history import StartState
from solver.settings import FIRST_HARMONICS, FollowedFrequency, Resolution, SolverSettings, ToTheEnd, WearTarget
from solver.structure.joint import Case
from solver.wear.check import end_of_wear, full_check, report_only, unstable_at_end
from solver.wear.course import Course, Node
from solver.wear.slow_time import AS_ASKED, RTOL_RATIO, Guide, Integrator, Solution
from solver.wear.step import Adaptive, Steps, WearLine
from solver.wear.wearing_joint import WearingJoint, WearState

HISTORY_ITERATIONS = 3000
"""Most Newton iterations of a history or a reference solution, in addition to `NEAR_ITERATIONS` for each step. A
travelling wave at its resonance: 1400 in a corner within 500 cycles."""

ITERATIONS_PER_SAVE = 100
"""Newton iterations after which a history is saved and its factorisation dropped, so that a resumed history is equal to
the last bit: 1 s of 48 pairs, 17 s of 336. The cost of one more factorisation is negligible."""


@dataclass(frozen=True)
class WearRequest:
    """What a wear history is asked for, Eqs. (20) to (26).

    wear_coefficient: k_w, 1/Pa. law: part of the slip work that wears.
    cycles (n_output,): ascending counts to report, the first 0; the last Euler step ends at the last one. Or
        `ToTheEnd`: until nothing wears any more; not with explicit steps, which cannot grow.
    until: target of the wear, with whose step the history ends. loops: pairs with reported fretting loops.
    ends_at_last: whether the last adaptive step ends at the last count, for a joint that vibrates otherwise from there.
    follow: what the frequency of the excitation follows; None for that of the start state.
    """

    wear_coefficient: float
    steps: Steps
    cycles: FloatArray | ToTheEnd
    law: WearLaw = ARCHARD
    until: WearTarget | None = None
    loops: tuple[int, ...] = ()
    ends_at_last: bool = False
    follow: FollowedFrequency | None = None

    @property
    def adaptive(self) -> bool:
        """Whether the steps control their own error."""
        return self.steps.scheme == "adaptive"

    @property
    def end(self) -> float:
        """Last cycle count; inf where it is not known."""
        return math.inf if isinstance(self.cycles, ToTheEnd) else float(self.cycles[-1])

    @property
    def name(self) -> str:
        """Tells apart histories from one start state with one wear coefficient and law."""
        target = None if self.until is None else astuple(self.until)
        return f"{self.steps!r} {self.end!r} {target!r}"


@dataclass(frozen=True)
class WearProblem:
    """The problem over the slow time of a history, or of the reference solution of an adaptive one.

    end: last cycle count, inf for a history to the end of wear. guide: of a reference solution; None for a history.
    stable_end: whether the stability of the last state is tested.
    """

    setup: WearingJoint
    asked: WearRequest
    end: float
    guide: Guide | None = None
    stable_end: bool = False

    @cached_property
    def line(self) -> WearLine:
        """The steps; adaptive ones go beyond the last count, where nothing else begins there."""
        asked, setup = self.asked, self.setup
        end = math.inf if asked.adaptive and not asked.ends_at_last else self.end
        if self.guide is None:
            return WearLine(setup, asked.steps, end)
        # a short history may consist of its first steps, which do not depend on rtol
        first = self.guide.first_length * (2.0 if asked.ends_at_last else 1.0)
        return WearLine(setup, Adaptive(RTOL_RATIO * setup.case.settings.rtol, first), end, bounded=False)

    @property
    def budget(self) -> Budget:
        """As in SlowProblem."""
        return self.setup.run.budget

    @property
    def iterations_per_save(self) -> int:
        """As in SlowProblem."""
        return ITERATIONS_PER_SAVE

    def saved(self, state: WearState) -> WearState:
        """As in SlowProblem: without the factorisation."""
        self.setup.drop_factor()
        return in_rows(state)

    def _ended(self, state: WearState, course: Course) -> Failure | None:
        """Why the history ends at a state; None to go on."""
        found, cycles, most = None, self.asked.cycles, HISTORY_ITERATIONS + NEAR_ITERATIONS * len(course.ends)
        still = not state.wears and self.end == math.inf
        if still or not math.isnan(course.reached) or course.ends[-1] >= self.end * (1.0 - 1e-12):
            found = AS_ASKED
        elif isinstance(cycles, ToTheEnd) and self.end == math.inf:
            found = end_of_wear(self.setup, state, course, cycles.final_share)
        if found is None and state.wears and self.budget.iterations > most:
            found = Failure(Outcome.MARCH_FAILED)
        if found is AS_ASKED and self.stable_end:
            found = unstable_at_end(self.setup, state) or found
        return found

    def advance(self, state: WearState | None, course: Course) -> tuple[WearState, Course] | Failure:
        """As in SlowProblem: the next state is checked and stored."""
        setup, asked, error = self.setup, self.asked, 0.0
        if state is None:
            found = setup.at_followed(setup.begin() if self.guide is None else begin_reference(setup))
        elif (ended := self._ended(state, course)) is not None:
            return ended
        elif not state.wears:
            # the state holds for all later counts
            return state, course.after(replace(course.nodes[-1], count=self.end))
        else:
            step = self.line.step(state)
            if isinstance(step, Failure):
                return step
            found, error = setup.out_of_range(step.state) or step.state, step.error
        if isinstance(found, Failure):
            return found
        shifts = asked.until is not None and asked.until.quantity == "frequency_shift"
        if self.guide is None:
            checked = full_check(setup, found, loops=asked.loops, with_resonance=shifts)
        else:
            checked = report_only(setup, found, self.guide.resolutions, with_resonance=shifts)
        if isinstance(checked, Failure):
            return checked
        after, report = checked
        if state is None:
            after = self.line.begin(after)
        else:
            error += course.nodes[-1].values["local"]
        if not after.resolutions or after.resolutions[-1][1] != after.resolution:
            after = replace(after, resolutions=(*after.resolutions, (after.cycle, after.resolution)))
        # local: sum of the local errors of the steps so far, m3
        return after, course.after(Node(after.cycle, after.depth, setup.rate(after.at), report | {"local": error}))


class Integrations:
    """Histories from one start state, which exists, and their reference solutions, each integrated once."""

    def __init__(self, case: Case, start: StartState, integrator: Integrator | None = None) -> None:
        self._case, self._start = case, start
        self._integrator = integrator or Integrator(case.settings.time_limit)

    def history(self, asked: WearRequest, spent: float = 0.0, *, stable_end: bool = True) -> Solution:
        """Integrate a history. spent: CPU seconds of its time limit so far. stable_end: as in WearProblem."""
        outputs = np.zeros(0) if isinstance(asked.cycles, ToTheEnd) else asked.cycles
        problem = WearProblem(self._joint(asked), asked, asked.end, stable_end=stable_end)
        course = Course(problem.setup.area, outputs, asked.until)
        return self._integrator.integrate(asked.name, problem, course, spent)

    def reference(self, asked: WearRequest, guide: Guide, compared: FloatArray, spent: float = 0.0) -> Solution:
        """Integrate the reference solution of an adaptive history of which the start state may be another one.

        compared (n,): ascending counts at which it is read, the first 0. spent: as for `history`.
        """
        setup = self._joint(asked)
        setup.run = setup.run.with_tolerance(self._case.settings.rough_tolerance)
        resolutions = tuple((count, coarser(resolution, self._case.model)) for count, resolution in guide.resolutions)
        problem = WearProblem(setup, asked, float(compared[-1]), replace(guide, resolutions=resolutions))
        course = Course(setup.area, compared)
        return self._integrator.integrate(f"{asked.name} reference", problem, course, spent)

    def _joint(self, asked: WearRequest) -> WearingJoint:
        return WearingJoint(self._case, self._start, asked.wear_coefficient, asked.law, asked.follow)


def coarser(resolution: Resolution, model: ReducedModel) -> Resolution:
    """Harmonics and samples of the reference solution: those of the next lower level. With one harmonic alone a joint
    that slips is another joint: three harmonics or one become more, where the model has matrices for them.
    """
    richer = shifted(resolution, 1)
    if resolution.highest <= FIRST_HARMONICS and model.holds(richer.highest):
        return richer
    # of automatic settings, which reduce both harmonics and samples
    return fewer(resolution, SolverSettings())


def begin_reference(setup: WearingJoint) -> WearState:
    """The unworn state of the reference solution.

    The state of the reference sweep has another tangential history, which may decide whether a pair goes on slipping
    while the joint wears. So the state is solved with twice the difference (dovetail, 212.5 Hz: 0.082 or 0.106 mm3;
    both sweeps lead to 0.082, twice their difference to 0.097); where it is not found, that of the sweep is taken.
    """
    begun, fine, reference = setup.begin(of_reference=True), setup.start.state, setup.start.reference
    if fine is None or reference is None:
        return begun
    history = fine.start_history + 2.0 * (reference.start_history - fine.start_history)
    balance = Balance(setup.joint_of(begun), history, begun.depth)
    point = setup.run.state(balance, begun.at.predicted_h, most=NEAR_ITERATIONS)
    return begun if point is None else setup.with_rates(replace(begun, point=point))
