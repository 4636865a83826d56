"""Estimated error of a state by its harmonics and samples, and the choice of both.

A state is solved again with more harmonics and with more samples. Each solve begins from the state. The change, times a
safety factor for the rest of the series, is the error. Automatic settings take more harmonics or more samples until the
error is below `rtol`. A state without even harmonics goes on without them; one in which nothing slips or opens keeps
the first harmonic only, which is then exact. Masses that ratchet are brought to rest first.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.accuracy.resolved_state import (
    FAINT_SHARE,
    HARMONIC_LEVELS,
    UNKNOWN,
    Estimate,
    ResolvedState,
    fewer,
    nothing_happens,
    reach,
    shifted,
    shortest_contact,
)
from solver.harmonic_balance.state import State
from solver.newton.linear_solver import SMALL_JOINT
from solver.newton.run import Run
from solver.settings import FINE_SAMPLES, Resolution, first_resolution
from solver.stability.disturbances import EXPENSIVE_UNKNOWNS
from solver.structure.joint import Case, Joint

TWO_LEVELS_SAFETY = 1.5
"""Error over the difference to the state two levels up, 2 to 1.2 where it falls as 1/H to 1/H^3, and to the state with
twice the samples, 2 to 1.3 for an error as the time step or its square."""

ONE_LEVEL_SAFETY = 2.5
"""Error over the difference to the state one level up: 3.4 to 1.5 for an error as 1/H to 1/H^3."""

TRIPLE_SAMPLES_SAFETY = 2.0
"""Error over the difference to three times the samples: 1.5 to 1.1, but the errors of single events scatter."""

RELAXED_FRACTION = 0.5
"""Fraction of rtol: error up to which harmonics are removed, so that the next state does not add them at once; and of
this error, below which fewer are tried."""

VIBRATION_RECHECK = 0.3
"""Relative change of the vibration after which harmonics are chosen again. Error of the motion of the dovetail on the
far side of the resonance: 5 % with 1.0, 0.5 % with 0.3."""

MOST_MIXED_HARMONICS = 79
"""Highest harmonic of "auto" with even harmonics: motions with impacts gain nothing from more."""

NODE_UNKNOWNS = 1600
"""Most unknowns of a node of a sweep, those of the dovetail of 48 pairs with five harmonics. Also of a small joint:
impacts couple all harmonics, and no preconditioner helps."""

MOST_UNKNOWNS = 8000
"""Most unknowns of a balance of 48 pairs in a history with "auto"."""

COMPARED_UNKNOWNS = 3 * MOST_UNKNOWNS // 2
"""Most unknowns of a balance that is solved to estimate an error."""

FAR_UNKNOWNS = 400
"""Most unknowns of a balance that only resolves a short contact, or the structure at higher harmonics."""

MOST_SAMPLES = 8192
"""Most samples of a period that "auto" takes."""

SAMPLES_OF_UNKNOWNS = 512
"""Most samples of a period at the largest number of unknowns; more with fewer unknowns. Nine pairs of a blade that lift
off at 2000 N: with 8192 samples the wear rate is no more accurate than with 2048."""

REFINEMENT_WORK = 1.2e6
"""Most Newton iterations of one refinement, times the unknowns two levels up: 200 of 48 pairs with nine harmonics."""


def refine(case: Case, joint: Joint, point: State, run: Run, *, node: bool = False) -> ResolvedState:
    """Estimate the error of a state at fixed wear depth; refine the state to an error below rtol in automatic settings.

    Returns the state with the harmonics and samples that it needs, or the last state found where none is accurate.

    case, joint, point: the state, its joint, and the case with its harmonics and samples.
    node: whether the state is a node of a sweep: with at least the first harmonics of automatic settings, as the next
        node may slip, and limited unknowns, as the difference to the reference sweep shows what they miss.
    """
    return _Search(run, run.budget.iterations, node).refined(ResolvedState(case, joint, point).at_rest(run))


@dataclass(frozen=True)
class _Search:
    """The search for a resolution. begun: Newton iterations at its start. run, node: as in `refine`."""

    run: Run
    begun: int
    node: bool

    def refined(self, here: ResolvedState) -> ResolvedState:
        """The state at the resolution that suffices, or the last state found."""
        settings, faint = here.case.settings, False
        while True:
            if nothing_happens(here.point.evaluation):
                here, faint = self._linear(here)
                if not faint:
                    return here
            if settings.harmonics == "auto":
                here = here.with_its_symmetry(self.run)
            by_samples, finer = self._samples_error(here)
            by_harmonics, richer = self._harmonics_error(here)
            estimate = by_samples + by_harmonics
            if not settings.automatic:
                return replace(here, estimate=estimate if np.isfinite(estimate.largest) else Estimate(np.nan, np.nan))
            holds = here.holds()
            if holds and estimate.largest <= settings.rtol:
                return self._relaxed(here, estimate)
            # samples and harmonics whose error alone is more than half of rtol are refined
            orders, samples = here.case.resolution.orders, here.case.resolution.samples
            if settings.harmonics == "auto" and (not holds or by_harmonics.largest > 0.5 * settings.rtol):
                above = shifted(here.case.resolution, 1)
                orders = above.orders
                samples = above.samples if settings.samples == "auto" else samples
            if settings.samples == "auto" and by_samples.largest > 0.5 * settings.rtol:
                samples = 2 * here.case.resolution.samples
            following = self._next(here, Resolution(orders, samples), finer, richer)
            if following is None:
                # slip that only many samples show is no reason to reject an accurate motion
                judged = estimate.response if faint else estimate.largest
                return replace(here, estimate=estimate, accurate=judged <= settings.rtol)
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
            missing = here.difference(finest).times(TWO_LEVELS_SAFETY)
            accurate = not settings.automatic or missing.largest <= settings.rtol
            return replace(here, estimate=missing, accurate=accurate), False
        while (samples := 2 * samples) < finest.case.resolution.samples:
            level = here.solve_at(Resolution(orders, samples), self.run)
            if level is not None and not nothing_happens(level.point.evaluation):
                return level, True
        return finest, True

    def _samples_error(self, here: ResolvedState) -> tuple[Estimate, ResolvedState | None]:
        """Estimated error by missing samples, and the state with more samples that gave it: 3 N + 2, as an event may
        stay next to the same one of 2 N samples. Many unknowns mean many events: then 2 N suffice.
        """
        orders, samples = here.case.resolution.orders, here.case.resolution.samples
        few = here.unknowns(here.case.resolution) <= EXPENSIVE_UNKNOWNS
        finer = self._compared(here, Resolution(orders, 3 * samples + 2 if few else 2 * samples))
        if finer is None:
            return UNKNOWN, None
        return here.difference(finer).times(TRIPLE_SAMPLES_SAFETY if few else TWO_LEVELS_SAFETY), finer

    def _harmonics_error(self, here: ResolvedState) -> tuple[Estimate, ResolvedState | None]:
        """Estimated error by missing harmonics, by a state with more, else with fewer; and the state with more."""
        resolution, higher = here.case.resolution, _richer(here)
        richer, found = self._compared(here, higher[-1]) if higher else None, len(higher)
        above, below = shifted(resolution, 1), shifted(resolution, -1)
        seen = 2 * above.highest < resolution.samples and self._allowed(here, above)
        if richer is None and here.case.settings.harmonics == "auto" and seen:
            # impacts: Newton's method diverges from a warm start with more harmonics, although the state exists
            richer, found = here.solve_at(above, self.run, with_tail=True), 1
        other = richer
        if other is None and below.highest < resolution.highest:
            other, found = self._compared(here, below), 2
        if other is None:
            return UNKNOWN, None
        return here.difference(other).times(ONE_LEVEL_SAFETY if found == 1 else TWO_LEVELS_SAFETY), richer

    def _compared(self, here: ResolvedState, resolution: Resolution) -> ResolvedState | None:
        """The state with other harmonics and samples, as accurately as a comparison needs; None where not found."""
        return here.solve_at(resolution, self.run.with_tolerance(here.case.settings.rough_tolerance))

    def _next(
        self, here: ResolvedState, wanted: Resolution, finer: ResolvedState | None, richer: ResolvedState | None
    ) -> ResolvedState | None:
        """The state with the wanted resolution, or else `richer`; None where none is found.

        finer, richer: known states with more samples and with more harmonics.
        """
        limit = self.begun + REFINEMENT_WORK / here.unknowns(shifted(here.case.resolution, 2))
        if wanted == here.case.resolution or not self._allowed(here, wanted) or self.run.budget.iterations >= limit:
            return None
        exact = next((each for each in (finer, richer) if each and each.case.resolution == wanted), None)
        found = (exact or here).solve_at(wanted, self.run)
        both = here.case.settings.harmonics == here.case.settings.samples == "auto"
        if found is None and richer and not exact and both and self._allowed(here, richer.case.resolution):
            return richer
        return found

    def _allowed(self, here: ResolvedState, resolution: Resolution) -> bool:
        """Whether "auto" may take these harmonics and samples."""
        unknowns, most = here.unknowns(resolution), here.most_unknowns(NODE_UNKNOWNS if self.node else MOST_UNKNOWNS)
        if 2 * resolution.highest >= resolution.samples:  # which are given
            return False
        # the contact law costs unknowns times samples
        if unknowns * resolution.samples > SAMPLES_OF_UNKNOWNS * most:
            return False
        if here.joint.component_index.size <= SMALL_JOINT:
            most = min(most, NODE_UNKNOWNS)
        if resolution.highest > MOST_MIXED_HARMONICS:
            # more harmonics for friction without impacts only, whose harmonics are odd
            most = min(most, EXPENSIVE_UNKNOWNS) if all(order % 2 for order in resolution.orders) else 0
        # the two highest levels serve for a comparison only
        in_levels = resolution.highest <= HARMONIC_LEVELS[-3] and here.case.model.has_harmonics(resolution.highest)
        return in_levels and resolution.samples <= MOST_SAMPLES and unknowns <= most

    def _relaxed(self, here: ResolvedState, estimate: Estimate) -> ResolvedState:
        """An accurate state with as few harmonics and samples as it needs for a fraction of rtol."""
        settings = here.case.settings
        enough, lowest = RELAXED_FRACTION * settings.rtol, first_resolution(settings).highest if self.node else 1
        while estimate.largest <= RELAXED_FRACTION * enough:
            lower = fewer(here.case.resolution, settings)
            if lower == here.case.resolution or lower.highest < lowest:
                break
            level = here.solve_at(lower, self.run)
            larger = UNKNOWN if level is None else level.difference(here).times(TWO_LEVELS_SAFETY) + estimate
            if level is None or larger.largest > enough or not level.holds():
                break
            here, estimate = level, larger
        return replace(here, estimate=estimate)


def _richer(here: ResolvedState) -> list[Resolution]:
    """Resolutions with more harmonics, level by level, up to that of a comparison, two levels up or, where cheap, one
    that resolves the shortest contact and beyond which structure and penalty agree.
    """
    resolution, at, model = here.case.resolution, here.point.evaluation, here.case.model
    levels = enumerate(shifted(resolution, level) for level in range(1, len(HARMONIC_LEVELS)))
    most = here.most_unknowns(COMPARED_UNKNOWNS), FAR_UNKNOWNS
    found = [
        each for place, each in levels if model.has_harmonics(each.highest) and here.unknowns(each) <= most[place > 1]
    ]
    if len(found) <= 2:
        return found
    contact = shortest_contact(at.status_t, at.force_t[:, 0], FAINT_SHARE * here.case.settings.rtol)
    wanted = max(1.0 / contact, reach(model, here.joint.omega, resolution.highest))
    return found[: max(2, 1 + sum(each.highest < wanted for each in found))]
