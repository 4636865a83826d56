"""A wear history, or its reference solution, as a problem over the slow time: its steps, their lengths, their rescues.

The difference of a history to its reference solution, pair by pair, is taken for the error. The reference solution
starts from another sweep, with half of the nodes (`solver.loading_history`), and is coarser: twice the tolerance of
the steps, the next lower harmonics and samples. These suffice for its states, as the history has one level more: else
their error is what the difference shows. With the harmonics of the history, and their error added, volumes of mesh 2
are known to 1 % at all points, but errors of depths and responses at 211.375 Hz are 0.3 to 0.4 of the true ones. Given
harmonics have many more beside them (`of_reference`). Where pairs stick again, a resonance passes or a branch ends,
errors grow, and this difference with them; a sum of local errors does not.

A history with given Euler steps is compared with the adaptive history, which all given steps share. A coarser history
with the same steps errs as they do: dovetail, 16 pairs, 212.5 Hz, where a pair only just slips: 1.89 mm3 with implicit
steps, 1.90 with steps of 250 cycles; the truth is 2.03.

In a final state every pair that slips carries no force. So a history to the end of wear ends where the wear rate of
every pair is below a fraction of its largest one. A joint that slips everywhere under a load that nothing else carries
has no final state: its wear rate becomes constant, and its steps double.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from solver.accuracy.refinement import FEWEST_OF_SERIES
from solver.accuracy.resolved_state import Estimate, fewer, shifted, with_highest
from solver.continuation.natural import FINE_STEP, NEAR_ITERATIONS, SMOOTH_CHANGE, Lengths, take_step
from solver.harmonic_balance.state import Failure, vibration_change
from solver.loading_history.sweep import NODE_ITERATIONS
from solver.model import FloatArray
from solver.newton.run import SHORTEST_STEP
from solver.outcome import Outcome, in_digits
from solver.results.history import StartState
from solver.settings import FIRST_HARMONICS, ROUND_OFF, SMALL_SHARE, Resolution, Scheme, SolverSettings, ToTheEnd
from solver.structure.joint import Case
from solver.wear.check import choose_harmonics, full_check, report_only, unstable_at_end, vibrates_otherwise
from solver.wear.jump import jump
from solver.wear.slow_time import RTOL_RATIO, Course, Guide, Node
from solver.wear.step import allowed_error, attempt_step, explicit_step_limit, too_long
from solver.wear.undecided import own_growth
from solver.wear.wearing_joint import WearingJoint, WearRequest, WearState

FIRST_STEP, FIRST_DEPTH = 0.05, 0.01
"""Length of the first adaptive step, whose error is not known, as a fraction of the explicit step limit, and its
largest wear, as a fraction of the largest relative motion. Half and twice: histories of slider, blocks and sphere are
equal within 4e-5, with 8 % fewer and 3 % more iterations."""

DOUBLINGS_ACROSS = 6
"""Most doublings of the shortest step to go across corners: to 6 % of the cycle count. Dovetail, mesh 2, nodal diameter
3, 213.5 Hz: steps across of 1.6 %, without which the history is `march_failed` at 847 cycles. With seven doublings a
pressed block that comes loose is found adrift."""

LONGEST_REFERENCE = 10
"""Most steps of a reference solution over those of its history and 20 more: with coarser harmonics a pair may slip by a
hair, in thousands of tiny steps (ring of six blades, 278 Hz). Its error is not known from there on."""

DEEPEST, STEPS_TO_THE_END = 1.0, 20_000
"""Depth, m, and steps beyond which wear has no end. A block on two pairs that nothing else carries is worn 1 m deep
after 22 steps, which double; a joint takes 2 to 10 steps a pair to its final state."""


class WearProblem(WearingJoint):
    """The joint of a history, or of the reference solution of an adaptive one, as `SlowProblem`; stepped by `take_step`
    over its cycles.

    guide: of a reference solution, with its own harmonics and first length; None for a history. A reference solution
        takes a step that is `too_long`: its difference is the warning, and in a last long step nearly all of the force
        of a joint at rest is moved.
    stable_end: whether the stability of the last state is tested.
    most_steps: of a reference solution (`LONGEST_REFERENCE`).
    limit: cycle count beyond which no step goes; inf for adaptive steps, unless the request `ends_at_last`, and for
        given steps to the end of wear.
    """

    # 1 s of 48 pairs, 17 s of 336; the cost of one more factorisation is negligible
    iterations_per_save = 100

    def __init__(
        self, case: Case, start: StartState, request: WearRequest, guide: Guide | None = None, stable_end: bool = False
    ) -> None:
        super().__init__(case, start, request)
        self.guide, self.stable_end = guide, stable_end
        self.unit = "cycle" if guide is None else "reference solution, cycle"
        self.name = f"{request.steps!r} {request.end!r} {request.until!r} {guide is None}"
        counts = np.zeros(0) if isinstance(request.cycles, ToTheEnd) else request.cycles
        self.course, self.most_steps = Course(self.area, counts, request.until), math.inf
        self.limit = math.inf if request.steps is None and not request.ends_at_last else request.end

    def advance(self, state: WearState | None, course: Course) -> tuple[WearState, Course] | Failure | None:
        """As in SlowProblem: the next state is checked and stored."""
        local = 0.0
        if state is None:
            unworn = self.unworn_state(None if self.guide is None else self.start.reference)
            # a history has the harmonics of its later states from the start
            end = choose_harmonics(self, unworn) if self.guide is None else self.at_followed(unworn)
        elif self._is_complete(state, course):
            return unstable_at_end(self, state) if self.stable_end else None
        elif (failure := self._gives_up(state, course)) is not None:
            return failure
        elif not self.wears(state):
            # the state holds for all later counts, and its friction dissipates on
            last, count = course.nodes[-1], self.request.end
            energy = last.energy + (count - last.count) * last.energy_rate
            return state, course.after(replace(last, count=count, energy=energy))
        else:
            end, local = self.step(state), course.nodes[-1].values["local"]
        if isinstance(end, Failure):
            return end
        checked = full_check(self, end) if self.guide is None else report_only(self, end, self.guide)
        if isinstance(checked, Failure):
            return checked
        after, report = checked
        lost = math.isinf(self.by_sweep.wear_rate)
        report["resolution_error"] = math.inf if lost else report["wear_rate_error"]
        if state is None or lost:
            report["response_error"] += self.by_sweep.response
            report["wear_rate_error"] += self.by_sweep.wear_rate
        if state is None:
            after = self.with_first_length(self._judged_alone(after, report) if self.request.end == 0.0 else after)
        known, now = after.guide.resolutions, after.point.resolution
        if not known or known[-1][1] != now:
            after = replace(after, guide=replace(after.guide, resolutions=(*known, (after.cycle, now))))
        # local: sum of the local errors of the steps so far, m3
        values = report | {"local": after.last.error + local}
        if self.guide is None and self.request.steps is None:
            values["own_growth"] = np.zeros(self.area.size) if state is None else own_growth(self, state, after)
        depth, energy = after.at.slow
        return after, course.after(Node(after.cycle, depth, after.rate, energy, after.energy_rate, values))

    def _judged_alone(self, state: WearState, report: dict[str, Any]) -> WearState:
        """The state of a history of zero cycles, whose response is the result: judged by its error with the sweep."""
        response, settings = report["response_error"], self.case.settings
        if self.guide is not None or not settings.automatic or response <= settings.rtol:
            return state
        worst = Estimate(response, 0.0).larger(state.record.worst)
        return replace(state, record=replace(state.record, inaccurate_from=0.0, worst=worst))

    def _is_complete(self, state: WearState, course: Course) -> bool:
        """Whether a history has come to its last count, its target, or its final state."""
        cycles = self.request.cycles
        if isinstance(cycles, ToTheEnd):
            largest = state.record.largest_rates[:-1]
            least = cycles.final_share * np.maximum(largest, cycles.final_share * float(largest.max(initial=0.0)))
            fades = bool((state.rate * self.area <= least).all()) and self.change_rate(state) == 0.0
            if not self.wears(state) or fades:
                return True
        return not math.isnan(course.reached) or course.ends[-1] >= self.request.end * (1.0 - 1e-12)

    def _gives_up(self, state: WearState, course: Course) -> Failure | None:
        """Why a history does not go on although it is not complete: its wear has no end, or takes too long."""
        n_steps, most = len(course.ends) - 1, NODE_ITERATIONS + NEAR_ITERATIONS * len(course.ends)
        within = state.depth.max() <= DEEPEST and n_steps < STEPS_TO_THE_END
        if isinstance(self.request.cycles, ToTheEnd) and not within:
            at = f"after {n_steps} steps, at cycle {in_digits(state.cycle, 4)}"
            rate = f"the joint still wears at {self.volume_rate(state):.6g} m3 a cycle"
            return Failure(Outcome.NO_FINAL_STATE, f"{at}, {rate}")
        if n_steps > self.most_steps:
            return Failure(Outcome.MARCH_FAILED, f"more than {LONGEST_REFERENCE} times as many steps as the history")
        if self.wears(state) and self.run.budget.iterations > most:
            said = f"more than {most} iterations in {n_steps + 1} steps, up to cycle {in_digits(state.cycle)}"
            return Failure(Outcome.MARCH_FAILED, said)
        return None

    def with_first_length(self, state: WearState) -> WearState:
        """The first state with its step limit, and the length of an adaptive step; at least two lead to the limit."""
        length, limit = state.next_length, math.inf
        if self.guide is not None:
            length = self.guide.first_length
        elif self.wears(state):
            limit = explicit_step_limit(self, state)
            moved, fastest = np.abs(state.at.displacement_h[:, :, 1:]).max(), state.rate.max()
            # the step limit is no bound where almost nothing slips
            lengths = [FIRST_STEP * limit, 0.5 * self.limit]
            lengths += [FIRST_DEPTH * moved / fastest] if fastest > 0.0 else []
            lengths += [FIRST_DEPTH / change] if (change := self.change_rate(state)) > 0.0 else []
            length = float(min(lengths))
        record, guide = replace(state.record, step_limit=limit), replace(state.guide, first_length=length)
        return replace(state, next_length=length, record=record, guide=guide)

    def step(self, state: WearState) -> WearState | Failure:
        """The state after one step, with the largest length of the next one; or why there is none."""
        length, shortest, steps = state.next_length, self._shortest(state), self.request.steps
        if steps is not None:
            length = steps.length
            if steps.depth is not None:
                fastest = float(state.rate.max())
                length = steps.depth / fastest if fastest > 0.0 else math.inf
            elif self.limit == math.inf:
                length *= float(state.record.largest_rates[-1] / self.volume_rate(state))
            else:
                left = length * (math.floor(state.cycle / length + ROUND_OFF) + 1.0) - state.cycle
                length = left if left < (1.0 - ROUND_OFF) * length else length
            shortest = SHORTEST_STEP * length
        length = length if state.last.before is None else min(length, state.next_length)
        # no extra step for a remainder below the round-off of the count
        if state.cycle + length >= self.limit * (1.0 - 1e-12):
            length = self.limit - state.cycle
        shortest = min(shortest, length)
        taken = take_step(self, state, length, Lengths(2, shortest=shortest, rescue=shortest))
        if isinstance(taken, Failure):
            return taken
        end, follow = replace(taken[0], next_length=taken[1]), self.request.follow
        if end.cycle >= self.limit * (1.0 - 1e-12):
            # the sum may be less by its last digit, and a history is not read beyond its last step
            end = replace(end, cycle=self.limit)
        if follow is not None and not follow.low <= end.point.omega / (2.0 * math.pi) <= follow.high:
            return self.lost(end)
        refused = too_long(self, state, end.depth, end.cycle - state.cycle) if steps is not None else None
        return refused or end

    def _shortest(self, state: WearState) -> float:
        """Shortest adaptive step, cycles: the accuracy to which the end of a branch is located."""
        return FINE_STEP * max(state.cycle, state.guide.first_length)

    def attempt(self, state: WearState, length: float, scheme: Scheme | None = None) -> WearState | None:
        """As in SteppedProblem. scheme: another one than that of the steps. A step ends in a stable state, which is
        tested after each Euler step, and where the vibration has changed since the last test; a followed resonance may
        be unstable at constant frequency. An adaptive step that is `too_long` becomes shorter.
        """
        steps = self.request.steps
        scheme = scheme or ("adaptive" if steps is None else steps.scheme)
        end = attempt_step(self, state, length, scheme)
        adapts = steps is None and self.guide is None
        if end is not None and adapts and too_long(self, state, end.depth, length) is not None:
            return None
        if end is None or self.request.follow is not None or (scheme == "adaptive" and not vibrates_otherwise(end)):
            return end
        return end if self.run.is_stable(self.joint_of(end), end.at) else None

    def ratio(self, state: WearState, end: WearState, length: float) -> float:
        """As in SteppedProblem: an Euler step counts whatever its error, the shortest adaptive step where the vibration
        changes little: at a corner of the wear rate.
        """
        if self.request.steps is not None:
            return 0.0
        (before, heat), (after, more_heat) = ((each.at.slow @ self.area).tolist() for each in (state, end))
        rtol = self.case.settings.rtol if self.guide is None else RTOL_RATIO * self.case.settings.rtol
        made = (before, after, end.last.error), (heat, more_heat, end.last.heat_error)
        allowed = [allowed_error(SMALL_SHARE * rtol, first, last, state.cycle, length) for first, last, _ in made]
        # of numpy: one that is NaN stays NaN
        ratio = float(np.max([error / most for (*_, error), most in zip(made, allowed, strict=True)]))
        smooth = length <= self._shortest(state) and vibration_change(state.at, end.at) < SMOOTH_CHANGE
        return min(ratio, 1.0) if smooth else ratio

    def rescue(self, state: WearState, length: float) -> WearState | Failure:
        """As in SteppedProblem. In this order: an Euler step, a longer one across corners (both adaptive), a jump."""
        if self.request.steps is None:
            end = self.attempt(state, length, "implicit") or self._step_across(state, length)
            if end is not None:
                return end
        worn = state.at.slow + length * np.array([state.rate, state.energy_rate])
        if self.guide is None and (failure := too_long(self, state, worn[0], length)) is not None:
            return failure
        beyond = jump(self, state, worn, state.cycle + length)
        if isinstance(beyond, Failure):
            return beyond if self.request.follow is None else self.lost(state)
        return self.at_followed(beyond)

    def _step_across(self, state: WearState, shortest: float) -> WearState | None:
        """A step longer than the shortest one, cycles, across corners of the branch; None where it is not found.

        Where the last pairs that stick come loose one by one, no step ends between the small folds, however short.
        """
        # a search without success leaves no trace: where a joint begins to slide, round-off decides what is found next
        before, self.run = self.run, self.run.fresh()
        for doubling in range(1, DOUBLINGS_ACROSS + 1):
            length = 2.0**doubling * shortest
            if state.cycle + length > self.limit:
                break
            end = self.attempt(state, length)
            if end is not None and vibration_change(state.at, end.at) < SMOOTH_CHANGE:
                return end
        self.run = before
        return None


def reference_of(
    case: Case, start: StartState, request: WearRequest, guide: Guide, counts: FloatArray, n_steps: float = math.inf
) -> WearProblem:
    """The reference solution of an adaptive history of n_steps, whose start state may be another one, to be read at
    ascending counts (n,), the first 0.
    """
    resolutions = tuple((count, of_reference(resolution, case)) for count, resolution in guide.resolutions)
    # a short history may consist of its first steps, which do not depend on rtol
    first_length = guide.first_length * (2.0 if request.ends_at_last else 1.0)
    problem = WearProblem(case, start, request.adaptive_to(counts), Guide(resolutions, first_length))
    problem.most_steps = LONGEST_REFERENCE * (n_steps + 20)
    return problem


def of_reference(resolution: Resolution, case: Case) -> Resolution:
    """Harmonics and samples of the reference solution. Of automatic ones, whose errors are small, those of the next
    lower level. Given ones may agree with a few more or fewer by chance (dovetail, 211.9976 Hz, 1.04 N: 5, 9 and 13 are
    4 % off and agree within 2 %), so that they have many more, and twice the samples, where the model has them; as have
    three or one, as with one alone a joint that slips is another joint.
    """
    now, has = resolution.highest, case.model.has_harmonics
    if case.settings.harmonics != "auto":
        level_above = shifted(resolution, 1).highest
        many = (each for each in range(max(level_above, FEWEST_OF_SERIES), level_above - 1, -1) if has(each))
        if (highest := next(many, None)) is not None:
            richer = with_highest(resolution, highest)
            return replace(richer, samples=max(richer.samples, 2 * resolution.samples))
    elif now <= FIRST_HARMONICS and has((richer := shifted(resolution, 1)).highest):
        return richer
    # of automatic settings, which reduce both harmonics and samples
    return fewer(resolution, SolverSettings())
