"""A state at one resolution (harmonics and samples), the corresponding states at others, and their differences.

A state is solved again with more harmonics or with more samples. The change, times a safety factor for the rest of the
series, is its error.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from solver.accuracy.certificate import SMALL_WORK, certify
from solver.accuracy.error_estimate import UNKNOWN, Estimate
from solver.accuracy.harmonic_levels import (
    MOST_UNKNOWNS,
    fewer,
    levels_to_reach,
    levels_to_see,
    n_unknowns,
    reach,
    room_for,
    shifted,
)
from solver.accuracy.options import ACCURACY
from solver.accuracy.period_events import half_wave_symmetric, lacks_even, nothing_happens, shortest_contact
from solver.continuation.homotopy import add_harmonics, start_with_tail
from solver.continuation.ratcheting import ratchets, shake_down
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.prolongation import transfer
from solver.harmonic_balance.response_peak import largest_responses
from solver.harmonic_balance.state import State
from solver.model import ComplexArray, FloatArray
from solver.newton.linear_solver import EXPENSIVE_UNKNOWNS, FORCING
from solver.newton.run import Run
from solver.settings import FINE_SAMPLES, NEGLIGIBLE, ROUND_OFF, Resolution, all_orders
from solver.structure.fourier import to_complex
from solver.structure.joint import Case, Joint

FAR_UNKNOWNS = 400
"""Most unknowns of a balance that only resolves a short contact, or the structure at higher harmonics."""

COMPARED_UNKNOWNS = 3 * MOST_UNKNOWNS // 2
"""Most unknowns of a balance that is solved to estimate an error."""

SMALL_PEAK = 0.01
"""Fraction of the largest peak: errors of smaller responses are relative to this fraction."""


@dataclass(frozen=True)
class ResolvedState:
    """A state with the case and the joint of its solution.

    usual_work: N m, lower bound of the slip work to which an error of the wear rate is relative; 0 for none.
    """

    case: Case
    joint: Joint
    point: State
    usual_work: float = 0.0

    def solve_at(self, resolution: Resolution, run: Run) -> ResolvedState | None:
        """The state with other harmonics and samples; None where it is not found."""
        return self._transferred(self.case, self.point.evaluation, resolution, run)

    def compared_at(self, resolution: Resolution, run: Run) -> ResolvedState | None:
        """As `solve_at`, as accurately as a comparison needs."""
        return self.solve_at(resolution, run.to(max(run.tolerance, FORCING * self.case.settings.rtol)))

    def unknowns(self, resolution: Resolution) -> int:
        """Number of unknowns of the balance with other harmonics."""
        return n_unknowns(resolution, self.joint.component_index.size)

    def may_solve(self, resolution: Resolution, most: int) -> bool:
        """Whether the scene has matrices for so many harmonics, and their balance at most `most` unknowns."""
        return self.unknowns(resolution) <= most and self.case.model.holds(resolution.highest)

    def by_homotopy(self, resolution: Resolution, run: Run) -> ResolvedState | None:
        """The same state with more harmonics, these raised from nothing; None where the homotopy ends.

        Where the homotopy of all of them at once ends, half of them are raised first.
        """
        found = self._in_one_homotopy(resolution, run)
        middle = (self.case.resolution.highest + resolution.highest) // 2
        orders = tuple(order for order in resolution.orders if order <= middle)
        if found is not None or orders in (self.case.resolution.orders, resolution.orders):
            return found
        half = self._in_one_homotopy(Resolution(orders, resolution.samples), run)
        return None if half is None else half.solve_at(resolution, run) or half._in_one_homotopy(resolution, run)

    def _in_one_homotopy(self, resolution: Resolution, run: Run) -> ResolvedState | None:
        if 2 * resolution.highest < self.case.resolution.samples:
            case = self.case.at(resolution)
            joint = case.joint(self.joint.omega, self.joint.excitation_amplitude)
            level = self._solved(case, joint, *start_with_tail(self.case, joint, self.point.evaluation), run)
            if level is not None:
                return level
        led = add_harmonics(self.case, self.joint, self.point.evaluation, resolution, run)
        if led is None:
            return None
        return self._transferred(replace(self.case, resolution=resolution), led, resolution, run)

    def _transferred(self, old: Case, evaluation: Evaluation, resolution: Resolution, run: Run) -> ResolvedState | None:
        """State solved from a state with other harmonics or with another penalty."""
        case = self.case.at(resolution)
        joint = case.joint(self.joint.omega, self.joint.excitation_amplitude)
        return self._solved(case, joint, *transfer(old, joint, evaluation), run)

    def _solved(self, case: Case, joint: Joint, balance: Balance, start: FloatArray, run: Run) -> ResolvedState | None:
        point = run.fresh().state(balance, start, self.point.parameter)
        # the mean position of a mass depends a little on the harmonics
        return None if point is None else replace(self, case=case, joint=joint, point=point).at_rest(run)

    def at_rest(self, run: Run) -> ResolvedState:
        """The state with its sliding masses at rest: their creep is slip and would count as wear."""
        settings = self.case.settings
        fraction = ACCURACY.negligible * settings.rtol
        if not ratchets(self.joint, self.point.evaluation, fraction):
            return self
        rested = shake_down(self.joint, self.point, fraction, run)
        return replace(self, point=rested)

    def least_work(self) -> float:
        """Slip work, N m, below which its relative error has less weight.

        It is the larger one of `usual_work` and a fraction of the work of the excitation.
        """
        motion = self.joint.to_relative(self.point.evaluation.displacement_h)
        return max(SMALL_WORK * abs(self.joint.structure.input_work(motion)), self.usual_work)

    def without_even(self, run: Run) -> ResolvedState | None:
        """The state solved with odd harmonics only; None where it needs even harmonics or holds none already."""
        orders = self.case.resolution.orders
        odd = tuple(order for order in orders if order % 2)
        if odd == orders or not half_wave_symmetric(self.point.evaluation, ROUND_OFF):
            return None
        return self.solve_at(Resolution(odd, self.case.resolution.samples), run)

    def with_even(self, run: Run) -> ResolvedState | None:
        """The state solved with all harmonics up to its highest; None unless it lacks even harmonics that it needs."""
        resolution = self.case.resolution
        if resolution.highest == 1 or not lacks_even(resolution.orders, self.point.evaluation):
            return None
        return self.solve_at(Resolution(all_orders(resolution.highest), resolution.samples), run)

    def missed_event(self, run: Run) -> ResolvedState | None:
        """The state with enough samples to show a slip, a separation or a contact between the samples; None if there is
        none. Without an event the harmonics are exact, so that one solve with the finest samples is enough.
        """
        orders, samples = self.case.resolution.orders, self.case.resolution.samples
        finest = self.solve_at(Resolution(orders, max(FINE_SAMPLES, 2 * samples)), run)
        if finest is None or nothing_happens(finest.point.evaluation):
            return None
        while (samples := 2 * samples) < finest.case.resolution.samples:
            level = self.solve_at(Resolution(orders, samples), run)
            if level is not None and not nothing_happens(level.point.evaluation):
                return level
        return finest

    def samples_error(self, run: Run) -> tuple[Estimate, ResolvedState | None]:
        """Estimated error by missing samples, and the state with more samples that gave it.

        The error depends on the position of an event (slip, stick, lift) between two of the N samples.

        - Twice as many samples contain the sample next to an event, which may still be the next one. Then both states
          have the same error. So the other state has 3 N + 2 samples, which share only the phases 0 and pi with the N.
        - Many unknowns mean many events. Then 2 N samples suffice, with which the refinement can go on.
        """
        orders, samples = self.case.resolution.orders, self.case.resolution.samples
        few = self.unknowns(self.case.resolution) <= EXPENSIVE_UNKNOWNS
        finer = self.compared_at(Resolution(orders, 3 * samples + 2 if few else 2 * samples), run)
        if finer is None:
            return UNKNOWN, None
        safety = ACCURACY.triple_samples_safety if few else ACCURACY.two_levels_safety
        return self.difference(finer).times(safety), finer

    def harmonics_error(self, run: Run, known: ResolvedState | None = None) -> tuple[Estimate, ResolvedState | None]:
        """Estimated error by missing harmonics, and the state with more harmonics that gave it.

        The error is the difference to the state with the most harmonics among the following ones. The state has to be
        found, its unknowns have to be few enough, and the scene has to hold its nodal diameters:

        - with enough harmonics to resolve the shortest contact, as far as cheap. Where no such state is found, the
          error is unknown, whatever the other states give;
        - with so many harmonics that structure and penalty agree beyond them (`reach`), as far as cheap: below, a few
          more harmonics may change nothing;
        - two levels of `harmonic_levels` up, or one level up;
        - one level down, which gives a larger error.

        known: a state with more harmonics from an earlier comparison, used again where it has enough of them.
        """
        evaluation = self.point.evaluation
        felt = ACCURACY.negligible * self.case.settings.rtol
        contact = shortest_contact(evaluation.status_t, evaluation.force_t[:, 0], felt)
        # a contact of one period of the highest harmonic is resolved well, one of half a period just resolved
        far, seeing = (levels_to_see(self.case.resolution, part * contact, 2) for part in (0.5, 1.0))
        while far > 2 and not self.may_solve(shifted(self.case.resolution, far), FAR_UNKNOWNS):
            far -= 1
        seeing = min(seeing, far)
        reaching = 2
        most = FAR_UNKNOWNS
        if self.may_solve(shifted(self.case.resolution, 2), most):
            reaching = levels_to_reach(
                self.case.resolution, reach(self.case.model, self.joint.omega, self.case.resolution.highest), 2
            )
            while not self.may_solve(shifted(self.case.resolution, reaching), most):
                reaching -= 1
        for levels in sorted({far, seeing, *range(1, reaching + 1), -1}, reverse=True):
            other = shifted(self.case.resolution, levels)
            affordable = self.unknowns(other) <= room_for(COMPARED_UNKNOWNS, self.joint.component_index.size)
            if other.highest != self.case.resolution.highest and self.case.model.holds(other.highest) and affordable:
                level = known if 2 < levels <= reaching and known is not None and known.covers(other) else None
                level = level or self.compared_at(other, run)
                if level is None and 2 < levels <= reaching:
                    level = self.level_by_level(levels, run)
                if level is not None:
                    richer = level if levels > 0 else None
                    if levels < seeing and seeing > 2:
                        return UNKNOWN, richer
                    safety = ACCURACY.one_level_safety if levels == 1 else ACCURACY.two_levels_safety
                    return self.difference(level).times(safety), richer
        return UNKNOWN, None

    def covers(self, resolution: Resolution) -> bool:
        """Whether the state has these harmonics and at least as many samples."""
        own = self.case.resolution
        return own.orders == resolution.orders and own.samples >= resolution.samples

    def level_by_level(self, levels: int, run: Run) -> ResolvedState | None:
        """The state `levels` up, solved one level after the other; None where one of them fails."""
        level: ResolvedState | None = self
        for _ in range(levels):
            level = None if level is None else level.solve_at(shifted(level.case.resolution, 1), run)
        return level

    def relaxed(self, estimate: Estimate, run: Run) -> tuple[ResolvedState, Estimate]:
        """The state with as few harmonics and samples as it needs, and its estimated errors.

        The error is kept below a fraction of rtol, so that the next state does not need more harmonics at once.
        estimate: errors of the present state.
        """
        here, enough = self, ACCURACY.kept_fraction * self.case.settings.rtol
        while estimate.largest <= ACCURACY.kept_fraction * enough:
            lower = fewer(here.case.resolution, here.case.settings)
            level = here.solve_at(lower, run) if lower != here.case.resolution else None
            if level is None:
                break
            larger = level.difference(here).times(ACCURACY.two_levels_safety) + estimate
            if larger.largest > enough or not level.holds():
                break
            here, estimate = level, larger
        return here, estimate

    def response(self) -> ComplexArray:
        """First harmonic of the responses (n_response,), m."""
        structure = self.joint.structure
        return to_complex(structure.response_h(self.joint.to_relative(self.point.evaluation.displacement_h)))[:, 0]

    @cached_property
    def peaks(self) -> FloatArray:
        """Largest magnitudes of the responses over the period (n_response,), m."""
        return largest_responses(self.joint, self.point.evaluation)

    def least_response(self) -> float:
        """Response, m, below which a relative error has no meaning, as for a mass that friction holds.

        It is a small fraction of the response that the excitation would cause on the stiffness of the joint alone.
        """
        structure = self.joint.structure
        moved = structure.harmonic_force / self.joint.relative_penalty
        response = np.abs(structure.dynamic_response[0]) @ np.abs(moved) + np.abs(structure.harmonic_offset)
        return max(NEGLIGIBLE * float(np.linalg.norm(response)), 1e-300)

    def holds(self) -> bool:
        """Whether all violations of the certificate are below their limits."""
        return certify(self.joint, self.point.evaluation).holds(self.case.settings.tolerance)

    def difference(self, better: ResolvedState) -> Estimate:
        """Relative differences of response and wear rate to a better state."""
        mine, its = self.response(), better.response()
        least = better.least_response()
        first = float(np.linalg.norm(mine - its)) / max(float(np.linalg.norm(its)), least)
        mine_peak, its_peak = self.peaks, better.peaks
        size = np.maximum(its_peak, max(SMALL_PEAK * float(its_peak.max(initial=0.0)), least))
        response = max(first, float((np.abs(mine_peak - its_peak) / size).max(initial=0.0)))
        mine_slip, its_slip = (float(level.point.evaluation.slip_work.sum()) for level in (self, better))
        work = max(self.least_work(), better.least_work())
        if max(its_slip, mine_slip) <= SMALL_WORK * work:
            return Estimate(response, 0.0)
        # the wear rate cannot be more accurate than the motion that causes it
        slip = max(its_slip, SMALL_WORK * work)
        return Estimate(response, max(first, abs(mine_slip - its_slip) / slip), slip / max(slip, work))
