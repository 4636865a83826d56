"""Estimated error of a state by its harmonics and samples, and the choice of both.

The error of a state is estimated by solving the state again with more harmonics and with more samples. Each solve
begins from the state. The change, times a safety factor for the rest of the series, is the error
(`solver.accuracy.resolved_state`).

Automatic settings take more harmonics or more samples until the estimate is below `rtol`:

- A state without even harmonics goes on without them.
- A state in which nothing slips or opens keeps the first harmonic only, which is then exact.
- Masses that ratchet are brought to rest first (`solver.continuation.ratcheting`).
- Where Newton's method diverges from a state with fewer harmonics, the others are added by homotopy
  (`solver.continuation.homotopy`), as far as the number of unknowns allows.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.accuracy.error_estimate import NOTHING, Estimate
from solver.accuracy.harmonic_levels import HARMONIC_LEVELS, MOST_UNKNOWNS, room_for, shifted
from solver.accuracy.options import ACCURACY
from solver.accuracy.period_events import nothing_happens
from solver.accuracy.resolved_state import ResolvedState
from solver.harmonic_balance.state import State
from solver.newton.linear_solver import EXPENSIVE_UNKNOWNS, SMALL_JOINT
from solver.newton.run import Run
from solver.settings import Resolution, SolverSettings
from solver.structure.joint import Case, Joint

MOST_MIXED_HARMONICS = 79
"""Highest harmonic of "auto" with even harmonics: motions with impacts gain nothing from more."""

NODE_UNKNOWNS = 1600
"""Most unknowns of a node of a sweep: about those of the dovetail of 48 pairs with five harmonics (1584). Most unknowns
of a small joint, too: impacts couple all harmonics, and no preconditioner helps."""

MOST_SAMPLES = 8192
"""Most samples of a period that "auto" takes."""

SAMPLES_OF_UNKNOWNS = 512
"""Most samples of a period at the largest number of unknowns; more with fewer unknowns. Nine pairs of a blade that lift
off at 2000 N: without this limit 27 harmonics take 8192 samples, 0.2 s an iteration, and the wear rate at the edge of
the contact is no more accurate than with 2048."""

REFINEMENT_WORK = 1.2e6
"""Most Newton iterations of one refinement, times the unknowns two levels up. Failed solves take most of them. A joint
of 48 pairs with nine harmonics may take 200."""


@dataclass(frozen=True)
class Refined:
    """A state with the harmonics and samples that it needs, or with the most that are allowed.

    case: the case, with the resolution of the state.
    point: the state, with the parameter of the state that was given.
    estimate: estimated errors of the state.
    accurate: whether the estimate is below rtol; only its response where slip shows with more samples than given.
        Always true for fixed settings.
    """

    case: Case
    point: State
    estimate: Estimate
    accurate: bool


def refine(
    case: Case,
    omega: float,
    excitation_amplitude: float,
    point: State,
    run: Run,
    most: float | None = None,
    usual_work: float = 0.0,
) -> Refined:
    """Estimate the error of a state at fixed wear depth; refine the state to an error below rtol in automatic settings.

    The result is the last state found, with its error, where none is accurate.

    case, point: the state and the case with its harmonics and samples. omega, excitation_amplitude: rad/s, N.
    most: most unknowns of a joint of 48 pairs with more harmonics (`room_for`), by default `MOST_UNKNOWNS`.
    usual_work: N m, lower bound of the slip work to which errors are relative, for states with almost no slip.
    """
    search = _Search(case.settings, run, run.budget.iterations, most or MOST_UNKNOWNS)
    return search.refined(ResolvedState(case, case.joint(omega, excitation_amplitude), point, usual_work).at_rest(run))


@dataclass
class _Search:
    """The search for the harmonics and samples that a state needs.

    settings: automatic harmonics and samples, and rtol.
    run: tolerance and limits.
    begun: Newton iterations at the start of the search.
    most: as in `refine`.
    faint: whether slip only shows with more samples than those of the given state.
    """

    settings: SolverSettings
    run: Run
    begun: int
    most: float
    faint: bool = False

    def refined(self, here: ResolvedState) -> Refined:
        """The state at the resolution that suffices, or the last state found."""
        richer: ResolvedState | None = None
        while True:
            if nothing_happens(here.point.evaluation):
                linear = self._linear(here)
                if isinstance(linear, Refined):
                    return linear
                here, self.faint = linear, True
                continue
            if self.settings.harmonics == "auto":
                here = here.without_even(self.run) or here.with_even(self.run) or here
            by_samples, finer = here.samples_error(self.run)
            by_harmonics, richer = self._harmonics_error(here, richer)
            estimate = by_samples + by_harmonics
            if not self.settings.automatic:
                known = estimate if np.isfinite(estimate.largest) else Estimate(np.nan, np.nan)
                return Refined(here.case, here.point, known, True)
            holds = here.holds()
            if holds and estimate.largest <= self.settings.rtol:
                here, estimate = here.relaxed(estimate, self.run)
                return Refined(here.case, here.point, estimate, True)
            wanted = self._wanted(here, by_samples.largest, by_harmonics.largest, holds=holds)
            following = self._next(here, wanted, finer, richer)
            if following is None:
                # slip that only many samples show is no reason to reject an accurate motion
                judged = estimate.response if self.faint else estimate.largest
                return Refined(here.case, here.point, estimate, judged <= self.settings.rtol)
            here = following

    def _linear(self, here: ResolvedState) -> Refined | ResolvedState:
        """Result for a state in which nothing slips or opens, or the state with more samples that show some slip."""
        if self.settings.harmonics == "auto" and here.case.resolution.orders != (1,):
            here = here.solve_at(Resolution((1,), here.case.resolution.samples), self.run) or here
        missed = here.missed_event(self.run)
        if missed is None:
            return Refined(here.case, here.point, NOTHING, True)
        if self.settings.samples == "auto":
            return missed
        missing = here.difference(missed).times(ACCURACY.two_levels_safety)
        accurate = not self.settings.automatic or missing.largest <= self.settings.rtol
        return Refined(here.case, here.point, missing, accurate)

    def _harmonics_error(
        self, here: ResolvedState, known: ResolvedState | None
    ) -> tuple[Estimate, ResolvedState | None]:
        """Error by missing harmonics, and the state with more harmonics that gave it."""
        error, richer = here.harmonics_error(self.run, known)
        above = shifted(here.case.resolution, 1)
        cheap = here.unknowns(above) <= EXPENSIVE_UNKNOWNS and self._allowed(here, above)
        if richer is None and self.settings.harmonics == "auto" and cheap:
            # impacts: Newton's method diverges from a warm start with more harmonics, although the state exists
            richer = here.by_homotopy(above, self.run)
            error = error if richer is None else here.difference(richer).times(ACCURACY.one_level_safety)
        return error, richer

    def _wanted(self, here: ResolvedState, by_samples: float, by_harmonics: float, *, holds: bool) -> Resolution:
        """The next resolution: samples and harmonics whose error alone is more than half of rtol are refined."""
        resolution, above = here.case.resolution, shifted(here.case.resolution, 1)
        wanted = resolution
        half = 0.5 * self.settings.rtol
        if self.settings.harmonics == "auto" and (not holds or by_harmonics > half):
            wanted = above if self.settings.samples == "auto" else Resolution(above.orders, resolution.samples)
        if self.settings.samples == "auto" and by_samples > half:
            wanted = Resolution(wanted.orders, 2 * resolution.samples)
        return wanted

    def _next(
        self, here: ResolvedState, wanted: Resolution, finer: ResolvedState | None, richer: ResolvedState | None
    ) -> ResolvedState | None:
        """The state with the wanted resolution, or a known state with more harmonics; None where none is found.

        finer, richer: known states with more samples and with more harmonics.
        """
        limit = self.begun + REFINEMENT_WORK / here.unknowns(shifted(here.case.resolution, 2))
        if wanted == here.case.resolution or not self._allowed(here, wanted) or self.run.budget.iterations >= limit:
            return None
        for known in (finer, richer):
            if known is not None and known.case.resolution == wanted:
                return known.solve_at(wanted, self.run)
        found = here.solve_at(wanted, self.run)
        if found is None and richer is not None and richer.case.resolution.highest > wanted.highest:
            # from a state with more harmonics instead of fewer
            found = richer.solve_at(wanted, self.run)
        if found is None and richer is not None and self.settings.harmonics == self.settings.samples == "auto":
            found = richer if self._allowed(here, richer.case.resolution) else None
        return found

    def _allowed(self, here: ResolvedState, resolution: Resolution) -> bool:
        """Whether "auto" may take these harmonics and samples."""
        if not here.case.model.holds(resolution.highest):
            return False
        n_rel = here.joint.component_index.size
        # the contact law costs unknowns times samples
        room = SAMPLES_OF_UNKNOWNS * room_for(self.most, n_rel)
        if here.unknowns(resolution) * resolution.samples > room:
            return False
        small = n_rel <= SMALL_JOINT
        most = room_for(min(self.most, NODE_UNKNOWNS) if small else self.most, n_rel)
        if resolution.highest > MOST_MIXED_HARMONICS:
            # more harmonics for friction without impacts only, whose harmonics are odd
            if not all(order % 2 for order in resolution.orders):
                return False
            most = min(most, EXPENSIVE_UNKNOWNS)
        # the two highest resolutions serve for a comparison only
        in_levels = resolution.highest <= HARMONIC_LEVELS[-3]
        return resolution.samples <= MOST_SAMPLES and in_levels and here.unknowns(resolution) <= most


def state_difference(case: Case, joint: Joint, one: State, other: State) -> Estimate:
    """Relative differences of response and wear rate of two states of one joint."""
    return ResolvedState(case, joint, one).difference(ResolvedState(case, joint, other))
