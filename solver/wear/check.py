"""Check of a state of a wearing joint: whether it is a result, and whether its harmonics and samples suffice."""

from dataclasses import replace
from typing import Any

import numpy as np

from solver.accuracy.certificate import NOT_CERTIFIED, Certificate, certify
from solver.accuracy.refinement import VIBRATION_RECHECK, refine, with_level_above
from solver.accuracy.resolved_state import ResolvedState, lacks_even, left_out
from solver.harmonic_balance.dlft import worn_by
from solver.harmonic_balance.state import Failure
from solver.outcome import Outcome, in_digits
from solver.results.state_report import report_state
from solver.settings import NEGLIGIBLE, SHARE_OF_CAUSE
from solver.stability.floquet import find_instability
from solver.wear.jump import creeps, free_slide
from solver.wear.slow_time import Guide
from solver.wear.wearing_joint import Checked, WearingJoint, WearState

LEFT_OUT_GROWN = 1.5
"""Growth of the part of the contact force in harmonics that are left out, since the last choice of harmonics, above
which a new choice is possible. Dovetail, 211.5, 211.75, 212.5 Hz: 0.8 to 1.4 over 1e5 cycles. With 1.2 and 3
histories of slider, blocks and sphere are equal within 4e-5."""


def full_check(wearing: WearingJoint, state: WearState) -> tuple[WearState, dict[str, Any]] | Failure:
    """A state of a history, possibly with other harmonics, and its report (`report_state`); or why it is rejected."""
    settings, certificate = wearing.case.settings, _certificate(wearing, state)
    # more harmonics or samples may suffice
    more_may_do = certificate.failures(settings.tolerance) and state.checked.accurate and settings.automatic
    if more_may_do or needs_new_choice(wearing, state):
        chosen = choose_harmonics(wearing, state, anew=True)
        if isinstance(chosen, Failure):
            return chosen
        state, certificate = chosen, _certificate(wearing, chosen)
    if said := certificate.sentence(settings.tolerance):
        return Failure(Outcome.CERTIFICATE_FAILED, f"at cycle {in_digits(state.cycle)}: {said}")
    # given harmonics and samples are accurate enough, unless there was no state with others for a comparison
    checked, record, joint = state.checked, state.record, wearing.joint_of(state)
    if not (checked.accurate and np.isfinite(checked.estimate.largest)):
        worst = max(record.worst, checked.estimate, key=lambda each: each.largest)
        record = replace(record, inaccurate_from=min(record.inaccurate_from, state.cycle), worst=worst)
    if joint.hold is not None and creeps(joint, joint.hold, state.at):
        said = "the friction on all pairs does not balance their mean force"
        return Failure(Outcome.ADRIFT, f"at cycle {in_digits(state.cycle)} {said}")
    if vibrates_otherwise(state):
        unstable = find_instability(wearing.case, state.point, wearing.run, False)
        if unstable is not None and not unstable.outcome.complete:
            return unstable
        checked = replace(checked, judged_h=state.at.predicted_h)
    state = replace(state, checked=checked, record=record)
    report = report_state(joint, state.at, certificate, wearing.request.loops, with_resonance=wearing.shifts)
    return state, report | {"excitation_frequency_error": wearing.frequency_error(state)}


def _certificate(wearing: WearingJoint, state: WearState) -> Certificate:
    """The certificate of a state, with the errors of the last choice of its harmonics."""
    estimate = state.checked.estimate
    wear_rate_error = wearing.wearing_work(state).amplification(*worn_by(state.at)) * estimate.wear_rate
    certificate = certify(wearing.joint_of(state), state.at)
    return replace(certificate, response_error=estimate.response, wear_rate_error=wear_rate_error)


def report_only(wearing: WearingJoint, state: WearState, guide: Guide) -> tuple[WearState, dict[str, Any]]:
    """A state of a reference solution with its report, where it is found with the harmonics wanted at its count."""
    wanted = [resolution for count, resolution in guide.resolutions if count <= state.cycle][-1]
    if wanted != state.point.resolution:
        point = wearing.run.move(wearing.case, state.point, wanted)
        moved = point and wearing.at_followed(wearing.with_rates(replace(state, point=point)))
        state = moved if isinstance(moved, WearState) else state
    return state, report_state(wearing.joint_of(state), state.at, NOT_CERTIFIED, with_resonance=wearing.shifts)


def needs_new_choice(wearing: WearingJoint, state: WearState) -> bool:
    """Whether harmonics and samples have to be chosen again: where the part of the contact force in harmonics that are
    left out, which grows with the error, is so large that the error may be above rtol, or so small that fewer may do.
    """
    settings, last = wearing.case.settings, state.checked
    if not settings.automatic:
        return False
    if settings.harmonics == "auto" and lacks_even(state.point):
        return True
    now, error = left_out(state.point), last.estimate.largest
    if not np.isfinite(error):
        return vibrates_otherwise(state)
    if error == 0.0:
        # the last choice was for a joint without slip and separation
        return now > NEGLIGIBLE
    if now > LEFT_OUT_GROWN * last.left_out:
        return error * now > settings.rtol * last.left_out
    return now < SHARE_OF_CAUSE**2 * last.left_out


def choose_harmonics(wearing: WearingJoint, state: WearState, *, anew: bool = False) -> WearState | Failure:
    """The state with one level of harmonics more than suffices, so that the reference solution may have those that do;
    a failure where the frequency then follows nothing. A history with given steps has no reference solution of its own,
    and one without wear none at all. anew: whether those of the state may not suffice.
    """
    checked = state.checked
    here = ResolvedState(state.point.case(wearing.case), state.point, checked.estimate, checked.accurate)
    here = refine(here, wearing.run) if anew else here
    if wearing.request.steps is None and wearing.wears(state) and wearing.request.end > 0.0:
        here = with_level_above(here, wearing.run)
    checked = Checked(left_out(here.point), here.estimate, here.accurate, checked.judged_h)
    return wearing.at_followed(wearing.with_rates(replace(state, point=here.point, checked=checked)))


def vibrates_otherwise(state: WearState) -> bool:
    """Whether the vibration differs from the vibration of the last stability check."""
    before, now = state.checked.judged_h[:, 1:], state.at.predicted_h[:, 1:]
    other = before.shape != now.shape
    return other or float(np.linalg.norm(now - before)) > VIBRATION_RECHECK * float(np.linalg.norm(before))


def unstable_at_end(wearing: WearingJoint, state: WearState) -> Failure | None:
    """Instability of the last state of a history, None if stable; INACCURATE where its stability, or that of the start
    state, which the sweep has judged already, is not known.
    """
    unknown = Failure(Outcome.INACCURATE, wearing.start.unjudged) if wearing.start.unjudged else None
    if state.cycle == 0.0 and wearing.request.follow is None and not vibrates_otherwise(state):
        return unknown
    joint = wearing.joint_of(state)
    # the determinant of a joint that is free to slide is zero, and its sign is round-off
    if free_slide(joint, state.at) is None and not wearing.run.is_stable(joint, state.at):
        said = f"at cycle {in_digits(state.cycle)} a small disturbance grows and keeps its sign, as between two folds"
        return Failure(Outcome.UNSTABLE, said)
    return find_instability(wearing.case, state.point, wearing.run, True) or unknown
