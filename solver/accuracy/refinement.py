"""Estimated error of a state by its harmonics and samples, and the choice of both.

A state is solved again with more samples, and is led by two Newton steps towards a series of many more harmonics. The
changes, times safety factors, are the errors. Automatic settings take more harmonics or more samples until their sum is
below `rtol`. A state without even harmonics goes on without them; one in which nothing slips or opens keeps the first
harmonic only, which is then exact. Masses that ratchet are brought to rest first.
"""

import math
from dataclasses import dataclass, replace
from functools import reduce

from solver.accuracy.resolved_state import (
    HARMONIC_LEVELS,
    UNKNOWN,
    Estimate,
    ResolvedState,
    fewer,
    nothing_happens,
    shifted,
    with_highest,
)
from solver.continuation.transient import SEARCH_ITERATIONS
from solver.newton.linear_solver import SMALL_JOINT
from solver.newton.run import Run
from solver.settings import FINE_SAMPLES, SHARE_OF_CAUSE, Resolution, first_resolution
from solver.stability.disturbances import EXPENSIVE_UNKNOWNS

DIFFERENCE_SAFETY = 1.5
"""Error over the difference to a better solution: to the state two levels up, 2 to 1.2 where it falls as 1/H to 1/H^3;
with twice the samples, 2 to 1.3 for an error as the time step or its square; of a history to its reference solution
(dovetail, 16 and 48 pairs, all schemes, steps of 250 to 2000 cycles: 0.02 to 1.4, in the median 0.3); of a mode to that
with more harmonics and samples. Estimated over true errors of modes: mass on a rigid slider at least 1.2, oscillator
with a wall 1.4, pressed foot that begins to slip 0.5, dovetail 2."""

SCATTERED_SAFETY = 2.0
"""Error over a difference that scatters: to three times the samples, 1.5 to 1.1, but for the errors of single events;
over the change in two Newton steps towards a longer series. Seven friction oscillators with 3 to 79 harmonics
and a higher mode near a multiple of the excitation: none is short by more than 2 %. Dovetail, 16 and 48 pairs, 3 to 27
harmonics: 1.0 to 3.7 times the error."""

FEWEST_OF_SERIES = 27
"""Fewest harmonics of the longer series of these steps. With 19 slider, blocks, waves and impacts are equal, a sphere
on a flat within 2e-4; with 39 the damper is within 1e-3 and takes more iterations."""

VIBRATION_RECHECK = 0.3
"""Relative change of the vibration after which harmonics are chosen again. Error of the motion of the dovetail on the
far side of the resonance: 5 % with 1.0, 0.5 % with 0.3. Half and twice: slider, blocks and ring are equal."""

MOST_MIXED_HARMONICS = 79
"""Highest harmonic of "auto" with even harmonics: motions with impacts gain nothing from more. With 39 a bouncing block
is known to 0.45 % in place of 0.25 %, and slider, masses and waves are equal."""

MOST_UNKNOWNS = 8000
"""Most unknowns of a balance of 48 pairs in a history with "auto". Half and twice: slider, blocks, waves and impacts
are equal, the sweep of the dovetail of 16 pairs within 2e-5."""

NODE_UNKNOWNS = MOST_UNKNOWNS // 2
"""Most unknowns of a node of a sweep, those of the dovetail of 48 pairs with 13 harmonics; it takes them where nine are
wrong by more than rtol. With nine at most, errors of 2.4 and 44 % are told at 211.375 and 212.5 Hz, where it is 0.4 and
1.2 %. Also of a small joint: impacts couple all harmonics, and no preconditioner helps."""

HIGHEST_ABOVE = {True: 13, False: 19}
"""Highest harmonic by the level more than suffices: of a node of a sweep, and of a history; with more histories take
much longer. Dovetail, 48 pairs, 212.5 Hz, where a pair comes to rest or slips on by a hair: 0.094 mm3 with nodes
of 5 harmonics, 0.072 with 9 and more. With 27 the sweep of an underplatform damper, all pairs of which slip and open,
is lost."""

LARGEST_SHARE = 0.75
"""Share of rtol: error of a state of a history by its harmonics up to which `HIGHEST_ABOVE` holds; the steps have the
rest. With 0.4 loads 7, 14, 16, 19 of `error_bars` take 3 to 13 times as long with `rtol` 1e-2, which they keep.
With 0.5 values of slider, blocks, waves and impacts are equal."""

MOST_OF_NODE = 39
"""Highest harmonic of a node of a sweep: the point itself takes what it needs. With 235, the sweep of one friction
oscillator takes more than 40 CPU s, with 39 less than 2; its point is as exact. With 27 and 79 slider, blocks, waves
and impacts are equal."""

MOST_SAMPLES = 8192
"""Most samples of a period that "auto" takes. With half as many the error of a block that friction alone holds is told
as 17 % in place of 8.5 %; waves, impacts, masses and the dovetail need no more than half."""

SAMPLES_OF_UNKNOWNS = 1024
"""Most samples of a period at the largest number of unknowns; more with fewer unknowns. Nine pairs of a blade that lift
off at 2000 N: with 8192 samples the wear rate is no more accurate than with 2048. With 512, too few for the
79 harmonics of the dovetail with 16 pairs that an `rtol` of 1e-3 needs."""

COMPARED_UNKNOWNS = 3 * MOST_UNKNOWNS // 2
"""Most unknowns of the balance of 48 pairs towards which steps are made to estimate an error."""


def refine(here: ResolvedState, run: Run, *, node: bool = False) -> ResolvedState:
    """Estimate the error of a state at fixed wear depth; refine the state to an error below rtol in automatic settings.

    Returns the state with the harmonics and samples that it needs, or the last state found where none is accurate.

    node: whether the state is a node of a sweep: with at least the first harmonics of automatic settings, as the next
        node may slip, and limited unknowns, as the difference to the reference sweep shows what they miss.
    """
    return _Search(run, run.budget.iterations, node).refined(here.at_rest(run))


def with_level_above(here: ResolvedState, run: Run, *, node: bool = False) -> ResolvedState:
    """The state with one more level of automatic harmonics, and its estimated error; the same where it is not found, or
    its error is not known to be smaller.

    Up to `HIGHEST_ABOVE`. node: as in `refine`; with the error of fewer harmonics.
    """
    above, settings = shifted(here.case.resolution, 1), here.case.settings
    enough = node or here.estimate.largest <= LARGEST_SHARE * settings.rtol
    if above.highest > HIGHEST_ABOVE[node] and enough:
        return here
    search = _Search(run, run.budget.iterations, node)
    if settings.harmonics != "auto" or nothing_happens(here.point.evaluation) or not search.allows(here, above):
        return here
    found = here.solve_at(above, run)
    if found is None:
        return here
    estimate = here.estimate if node else search.samples_error(found) + search.harmonics_error(found)
    better = node or estimate.largest < here.estimate.largest
    return replace(found, estimate=estimate, accurate=here.accurate) if better else here


@dataclass(frozen=True)
class _Search:
    """The search for a resolution. begun: Newton iterations at its start. run, node: as in `refine`."""

    run: Run
    begun: int
    node: bool

    def refined(self, here: ResolvedState) -> ResolvedState:
        settings, faint, best = here.case.settings, False, replace(here, estimate=UNKNOWN, accurate=False)
        while True:
            if nothing_happens(here.point.evaluation):
                here, faint = self._linear(here)
                if not faint:
                    return here
            if settings.harmonics == "auto":
                here = here.with_its_symmetry(self.run)
            by_samples, by_harmonics = self.samples_error(here), self.harmonics_error(here)
            estimate = by_samples + by_harmonics
            if not settings.automatic:
                return replace(here, estimate=estimate, accurate=math.isfinite(estimate.largest))
            holds = here.holds()
            if holds and estimate.largest <= settings.rtol:
                return self._relaxed(here, estimate)
            # samples and harmonics whose error alone is more than half of rtol are refined
            orders, samples = here.case.resolution.orders, here.case.resolution.samples
            if settings.harmonics == "auto" and (not holds or by_harmonics.largest > SHARE_OF_CAUSE * settings.rtol):
                above = shifted(here.case.resolution, 1)
                orders = above.orders
                samples = above.samples if settings.samples == "auto" else samples
            if settings.samples == "auto" and by_samples.largest > SHARE_OF_CAUSE * settings.rtol:
                samples = 2 * here.case.resolution.samples
            following = self._next(here, Resolution(orders, samples))
            if holds and estimate.largest <= best.estimate.largest:
                best = replace(here, estimate=estimate)
            if following is None:
                best = best if math.isfinite(best.estimate.largest) else replace(here, estimate=estimate)
                # slip that only many samples show is no reason to reject an accurate motion
                judged = best.estimate.response if faint else best.estimate.largest
                return replace(best, accurate=judged <= settings.rtol)
            here = following

    def _linear(self, here: ResolvedState) -> tuple[ResolvedState, bool]:
        """A state without slip and opening, with its error, or with more samples that show some; whether they do."""
        settings, samples = here.case.settings, here.case.resolution.samples
        lowest = first_resolution(settings).orders if self.node else (1,)
        if settings.harmonics == "auto" and here.case.resolution.orders != lowest:
            here = here.solve_at(Resolution(lowest, samples), self.run) or here
        # without an event the harmonics are exact, so that one solve with the finest samples is enough
        orders = here.case.resolution.orders
        finest = here.solve_at(Resolution(orders, max(FINE_SAMPLES, 2 * samples)), self.run)
        if finest is None or nothing_happens(finest.point.evaluation):
            return here, False
        if settings.samples != "auto":
            missing = here.difference(finest).times(DIFFERENCE_SAFETY)
            accurate = not settings.automatic or missing.largest <= settings.rtol
            return replace(here, estimate=missing, accurate=accurate), False
        while (samples := 2 * samples) < finest.case.resolution.samples:
            level = here.solve_at(Resolution(orders, samples), self.run)
            if level is not None and not nothing_happens(level.point.evaluation):
                return level, True
        return finest, True

    def samples_error(self, here: ResolvedState) -> Estimate:
        """Estimated error by missing samples, by a state with 3 N + 2, as an event may stay next to the same one of 2 N
        samples. Many unknowns mean many events: then 2 N suffice. Unknown where this state is not found.
        """
        orders, samples = here.case.resolution.orders, here.case.resolution.samples
        few = here.unknowns(here.case.resolution) <= EXPENSIVE_UNKNOWNS
        run = self.run.with_tolerance(here.case.settings.rough_tolerance)
        finer = here.solve_at(Resolution(orders, 3 * samples + 2 if few else 2 * samples), run)
        if finer is None:
            return UNKNOWN
        return here.difference(finer).times(SCATTERED_SAFETY if few else DIFFERENCE_SAFETY)

    def harmonics_error(self, here: ResolvedState) -> Estimate:
        """Estimated error by missing harmonics: the change in Newton steps towards a much longer series, the largest
        change where they do not contract. Unknown where the model has no more harmonics.

        No solution is needed: with many more harmonics it may not be found from here, and a solution with a few more
        may agree with the state by chance.
        """
        series = longer_series(here)
        if series is None:
            return UNKNOWN
        reached, contracts = here.steps_to(series, self.run)
        changes = [here.difference(each) for each in reached] or [UNKNOWN]
        change = changes.pop().times(SCATTERED_SAFETY)
        return change if contracts else reduce(Estimate.larger, changes, change)

    def _next(self, here: ResolvedState, wanted: Resolution) -> ResolvedState | None:
        """The state with the wanted resolution, or with one more level of harmonics; None where none is found."""
        now = here.case.resolution
        if wanted == now or self.run.budget.iterations >= self.begun + SEARCH_ITERATIONS:
            return None
        if (more := wanted.orders != now.orders) and not self.allows(here, wanted):
            # with more samples, too, these harmonics are not allowed: nodes of the dovetail had 13 where 27 are
            fewest = shifted(now, 1).samples if here.case.settings.samples == "auto" else now.samples
            wanted = replace(wanted, samples=min(wanted.samples, fewest))
        # impacts: Newton's method diverges from a start without force in the new harmonics
        starts = [(each, tail) for each in (wanted, shifted(wanted, 1)) for tail in (False, True)]
        for resolution, with_tail in starts if more else starts[:1]:
            if not self.allows(here, resolution):
                return None
            found = here.solve_at(resolution, self.run, with_tail=with_tail)
            if found is not None:
                return found
        return None

    def allows(self, here: ResolvedState, resolution: Resolution) -> bool:
        """Whether "auto" may take these harmonics and samples."""
        unknowns, most = here.unknowns(resolution), here.most_unknowns(NODE_UNKNOWNS if self.node else MOST_UNKNOWNS)
        # samples that are given may be few; the contact law costs unknowns times samples
        fewest, largest = 2 * resolution.highest + 1, min(MOST_SAMPLES, SAMPLES_OF_UNKNOWNS * most / unknowns)
        if here.joint.component_index.size <= SMALL_JOINT:
            most = min(most, NODE_UNKNOWNS)
        if resolution.highest > MOST_MIXED_HARMONICS:
            # more harmonics for friction without impacts only, whose harmonics are odd
            most = min(most, EXPENSIVE_UNKNOWNS) if all(order % 2 for order in resolution.orders) else 0
        # the two highest levels serve for a comparison only
        highest = MOST_OF_NODE if self.node else HARMONIC_LEVELS[-3]
        in_levels = resolution.highest <= highest and here.case.model.has_harmonics(resolution.highest)
        return in_levels and fewest <= resolution.samples <= largest and unknowns <= most

    def _relaxed(self, here: ResolvedState, estimate: Estimate) -> ResolvedState:
        """An accurate state with as few harmonics and samples as it needs for a fraction of rtol."""
        settings = here.case.settings
        enough, lowest = SHARE_OF_CAUSE * settings.rtol, first_resolution(settings).highest if self.node else 1
        while estimate.largest <= SHARE_OF_CAUSE * enough:
            lower = fewer(here.case.resolution, settings)
            if lower == here.case.resolution or lower.highest < lowest:
                break
            level = here.solve_at(lower, self.run)
            larger = UNKNOWN if level is None else level.difference(here).times(DIFFERENCE_SAFETY) + estimate
            if level is None or larger.largest > enough or not level.holds():
                break
            here, estimate = level, larger
        return replace(here, estimate=estimate)


def longer_series(here: ResolvedState) -> Resolution | None:
    """Resolution with `FEWEST_OF_SERIES` harmonics, or three times as many as now: the longest with at most
    `COMPARED_UNKNOWNS` that the model has; at least two levels up, None where the model does not have these.
    """
    now, model, most = here.case.resolution, here.case.model, here.most_unknowns(COMPARED_UNKNOWNS)
    two_up = shifted(now, 2)
    longer = (with_highest(now, each) for each in range(max(FEWEST_OF_SERIES, 3 * now.highest), two_up.highest, -1))
    fitting = (each for each in longer if here.unknowns(each) <= most)
    return next((each for each in (*fitting, two_up) if model.has_harmonics(each.highest)), None)
