"""Check of a state of a wearing joint before it is reported: certificate, harmonics and samples, stability."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.accuracy.certificate import NOT_CERTIFIED, certify
from solver.accuracy.error_estimate import UNKNOWN
from solver.accuracy.harmonic_levels import lacks_even, left_out
from solver.accuracy.refinement import KEPT_FRACTION, VIBRATION_RECHECK, refine
from solver.harmonic_balance.dlft import worn_by
from solver.harmonic_balance.state import Failure
from solver.outcome import Outcome
from solver.results.state_report import StateReport, report_state
from solver.settings import NEGLIGIBLE, Resolution
from solver.stability.floquet import find_instability
from solver.wear.jump import creeps, free_slide
from solver.wear.state import Choice, WearState
from solver.wear.wearing_joint import Following, WearingJoint

LEFT_OUT_GROWN = 1.5
"""Growth of the part of the contact force in harmonics that are left out, since the last choice of harmonics, above
which a new choice is possible. Dovetail, 211.5, 211.75, 212.5 Hz: 0.8 to 1.4 over 1e5 cycles."""

Checked = tuple[WearState, StateReport]
"""A state that passed the check, possibly with other harmonics than before, and its report."""


@dataclass(frozen=True)
class FullCheck:
    """The check of a reported history.

    loops: pairs with reported fretting loops.
    with_resonance: whether the resonance of the vibration is reported.
    """

    loops: tuple[int, ...] = ()
    with_resonance: bool = False

    def __call__(self, work: WearingJoint, state: WearState) -> Checked | Failure:
        """The state with its report, or the reason of a rejection. Raises OutOfTimeError, LinAlgError."""
        choose = chosen_for_another(work, state)
        checked = self._report(work, state, choose=choose)
        if isinstance(checked, Failure) and not choose and state.choice.accurate and work.case.settings.automatic:
            # more harmonics or samples may suffice
            checked = self._report(work, state, choose=True)
        if isinstance(checked, Failure):
            return checked
        state, report = checked
        state = _note_accuracy(state)
        at = state.point.evaluation
        if state.hold is not None and creeps(work.at(state), state.hold, at):
            return Failure(Outcome.ADRIFT)
        if _vibrates_otherwise(state):
            if (unstable := _multipliers(work, state, every=False)) is not None:
                return unstable
            state = replace(state, judged_h=at.predicted_h)
        return state, report

    def _report(self, work: WearingJoint, state: WearState, *, choose: bool) -> Checked | Failure:
        """Report with certificate; its estimated errors come from the last choice of the harmonics."""
        chosen = choose_anew(work, state) if choose else state
        if isinstance(chosen, Failure):
            return chosen
        joint, at, estimate = work.at(chosen), chosen.point.evaluation, chosen.choice.estimate
        certificate = replace(
            certify(joint, at),
            response_error=estimate.response,
            wear_rate_error=work.wearing.amplification(*worn_by(at)) * estimate.wear_rate,
        )
        if not certificate.holds(work.case.settings.tolerance):
            return Failure(Outcome.CERTIFICATE_FAILED)
        report = report_state(joint, at, certificate, self.loops, with_resonance=self.with_resonance)
        if isinstance(work.where, Following):
            error = work.where.error(chosen, estimate.response, work.case.settings.rtol)
            report = replace(report, excitation_frequency_error=error)
        return chosen, report


@dataclass(frozen=True)
class PlainCheck:
    """No check, for a reference solution: its harmonics only follow a given schedule.

    resolutions: cycle count from which on a resolution holds, and this resolution; ascending counts, the first 0.
    with_resonance: whether the resonance of the vibration is reported.
    """

    resolutions: tuple[tuple[float, Resolution], ...]
    with_resonance: bool = False

    def __call__(self, work: WearingJoint, state: WearState) -> Checked | Failure:
        """The state with the harmonics wanted at its count, or unchanged where no such state is found."""
        wanted = [resolution for count, resolution in self.resolutions if count <= state.cycle][-1]
        state = _with_harmonics(work, state, wanted)
        joint, at = work.at(state), state.point.evaluation
        return state, report_state(joint, at, NOT_CERTIFIED, with_resonance=self.with_resonance)


def _with_harmonics(work: WearingJoint, state: WearState, wanted: Resolution) -> WearState:
    """The state solved with other harmonics and samples, at the frequency that is then followed; else as it is."""
    if wanted == state.resolution:
        return state
    work.at(state)
    joint = work.case.at(wanted).joint(state.omega, work.excitation_amplitude)
    point = work.run.move(work.case, joint, state.point)
    if point is None:
        return state
    found = work.at_followed(replace(state, point=point, resolution=wanted))
    return state if isinstance(found, Failure) else found


def chosen_for_another(work: WearingJoint, state: WearState) -> bool:
    """Whether the state differs so much from the last choice of harmonics and samples that a new choice is necessary.

    The part of the contact force in harmonics that are left out grows with the error of the state. A new choice is
    necessary where this part is so large that the error may be above rtol, or so small that fewer harmonics may do.
    """
    choice, at, settings = state.choice, state.point.evaluation, work.case.settings
    if not settings.automatic:
        return False
    if settings.harmonics == "auto" and lacks_even(state.resolution.orders, at):
        return True
    now, error = left_out(state.resolution.orders, at), choice.estimate.largest
    if not np.isfinite(error):
        return _vibrates_otherwise(state)
    if error == 0.0:
        # the last choice was for a joint without slip and separation
        return now > NEGLIGIBLE
    if now > LEFT_OUT_GROWN * choice.left_out:
        return error * now > settings.rtol * choice.left_out
    return now < KEPT_FRACTION**2 * choice.left_out


def choose_anew(work: WearingJoint, state: WearState) -> WearState | Failure:
    """The state with harmonics and samples chosen anew; a failure where the frequency then follows nothing."""
    work.at(state)
    refined = refine(work.case, state.omega, work.excitation_amplitude, state.point, work.run)
    resolution = refined.case.resolution
    choice = Choice(left_out(resolution.orders, refined.point.evaluation), refined.estimate, refined.accurate)
    return work.at_followed(replace(state, point=refined.point, resolution=resolution, choice=choice))


def _note_accuracy(state: WearState) -> WearState:
    """The state with the count from which on its harmonics do not suffice, and with the largest error since."""
    estimate, worst = state.choice.estimate, state.worst
    # NaN for given harmonics and samples, where no state with others was found for a comparison
    known = not np.isnan(estimate.largest)
    if state.choice.accurate and known:
        return state
    if not estimate.largest < worst.largest:
        worst = estimate if known else UNKNOWN
    return replace(state, inaccurate_from=min(state.inaccurate_from, state.cycle), worst=worst)


def _vibrates_otherwise(state: WearState) -> bool:
    """Whether the vibration differs from the vibration of the last stability check."""
    if state.judged_h is None or state.judged_h.shape != state.point.evaluation.predicted_h.shape:
        return True
    before, now = state.judged_h[:, 1:], state.point.evaluation.predicted_h[:, 1:]
    return float(np.linalg.norm(now - before)) > VIBRATION_RECHECK * float(np.linalg.norm(before))


def _multipliers(work: WearingJoint, state: WearState, *, every: bool) -> Failure | None:
    """Instability of a state by its Floquet multipliers, None if stable; every: as in `find_instability`."""
    joint = work.at(state)
    return find_instability(work.case, joint, state.point.evaluation, work.run, every)


def unstable_at_end(work: WearingJoint, state: WearState) -> Failure | None:
    """Instability of the last state of a history, None if stable. The sweep has judged the start state already."""
    if state.cycle == 0.0 and not work.where.follows and not _vibrates_otherwise(state):
        return None
    joint, at = work.at(state), state.point.evaluation
    # the determinant of a joint that is free to slide is zero, and its sign is round-off
    if free_slide(joint, at) is None and not work.is_stable(joint, at):
        return Failure(Outcome.UNSTABLE)
    return _multipliers(work, state, every=True)
