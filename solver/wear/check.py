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
from solver.settings import NEGLIGIBLE, ONE_OF_TWO
from solver.stability.floquet import find_instability
from solver.wear.jump import creeps, free_slide
from solver.wear.slow_time import Guide
from solver.wear.wearing_joint import WearingJoint, WearState

LEFT_OUT_GROWN = 1.5
"""Growth of the part of the contact force in harmonics that are left out, since the last choice of harmonics, above
which a new choice is possible. Dovetail, 211.5, 211.75, 212.5 Hz: 0.8 to 1.4 over 1e5 cycles. With 1.2 and 3
histories of slider, blocks and sphere are equal within 4e-5."""


def full_check(wearing: WearingJoint, state: WearState) -> tuple[WearState, dict[str, Any]] | Failure:
    """A state of a history, possibly with other harmonics, and its report (`report_state`); or why it is rejected."""
    settings, certificate = wearing.case.settings, _certificate(wearing, state)
    # more harmonics or samples may suffice
    more_may_do = certificate.failures(settings.tolerance) and state.accurate and settings.automatic
    if more_may_do or needs_new_choice(wearing, state):
        chosen = choose_harmonics(wearing, state, anew=True)
        if isinstance(chosen, Failure):
            return chosen
        state, certificate = chosen, _certificate(wearing, chosen)
    if said := certificate.sentence(settings.tolerance):
        return Failure(Outcome.CERTIFICATE_FAILED, f"at cycle {in_digits(state.cycle)}: {said}")
    # given harmonics and samples are accurate enough, unless there was no state with others for a comparison
    if not (state.accurate and np.isfinite(state.estimate.largest)):
        worst = max(state.worst, state.estimate, key=lambda each: each.largest)
        state = replace(state, inaccurate_from=min(state.inaccurate_from, state.cycle), worst=worst)
    case, joint = wearing.case_and_joint(state)
    if state.hold is not None and creeps(joint, state.hold, state.at):
        said = "the friction on all pairs does not balance their mean force"
        return Failure(Outcome.ADRIFT, f"at cycle {in_digits(state.cycle)} {said}")
    if vibrates_otherwise(state):
        unstable = find_instability(case, joint, state.at, wearing.run, False)
        if unstable is not None and not unstable.outcome.complete:
            return unstable
        state = replace(state, judged_h=state.at.predicted_h)
    report = report_state(joint, state.at, certificate, wearing.request.loops, with_resonance=wearing.shifts)
    return state, report | {"excitation_frequency_error": wearing.frequency_error(state)}


def _certificate(wearing: WearingJoint, state: WearState) -> Certificate:
    """The certificate of a state, with the errors of the last choice of its harmonics."""
    estimate = state.estimate
    wear_rate_error = wearing.wearing_work.amplification(*worn_by(state.at)) * estimate.wear_rate
    certificate = certify(wearing.joint_of(state), state.at)
    return replace(certificate, response_error=estimate.response, wear_rate_error=wear_rate_error)


def report_only(wearing: WearingJoint, state: WearState, guide: Guide) -> tuple[WearState, dict[str, Any]]:
    """A state of a reference solution with its report, where it is found with the harmonics wanted at its count."""
    wanted = [resolution for count, resolution in guide.resolutions if count <= state.cycle][-1]
    if wanted != state.resolution:
        case, _ = wearing.case_and_joint(state)
        point = wearing.run.move(case, case.at(wanted).joint(state.omega, wearing.excitation_amplitude), state.point)
        moved = point and wearing.at_followed(wearing.with_rates(replace(state, point=point, resolution=wanted)))
        state = moved if isinstance(moved, WearState) else state
    return state, report_state(wearing.joint_of(state), state.at, NOT_CERTIFIED, with_resonance=wearing.shifts)


def needs_new_choice(wearing: WearingJoint, state: WearState) -> bool:
    """Whether harmonics and samples have to be chosen again: where the part of the contact force in harmonics that are
    left out, which grows with the error, is so large that the error may be above rtol, or so small that fewer may do.
    """
    settings, orders = wearing.case.settings, state.resolution.orders
    if not settings.automatic:
        return False
    if settings.harmonics == "auto" and lacks_even(orders, state.at):
        return True
    now, error = left_out(orders, state.at), state.estimate.largest
    if not np.isfinite(error):
        return vibrates_otherwise(state)
    if error == 0.0:
        # the last choice was for a joint without slip and separation
        return now > NEGLIGIBLE
    if now > LEFT_OUT_GROWN * state.left_out:
        return error * now > settings.rtol * state.left_out
    return now < ONE_OF_TWO**2 * state.left_out


def choose_harmonics(wearing: WearingJoint, state: WearState, *, anew: bool = False) -> WearState | Failure:
    """The state with one level of harmonics more than suffices, so that the reference solution may have those that do;
    a failure where the frequency then follows nothing. A history with given steps has no reference solution of its own,
    and one without wear none at all. anew: whether those of the state may not suffice.
    """
    here = ResolvedState(*wearing.case_and_joint(state), state.point, state.estimate, state.accurate)
    here = refine(here, wearing.run) if anew else here
    if wearing.request.steps is None and state.wears and wearing.request.end > 0.0:
        here = with_level_above(here, wearing.run)
    resolution, point = here.case.resolution, here.point
    state = replace(state, point=point, resolution=resolution, left_out=left_out(resolution.orders, point.evaluation))
    state = replace(state, estimate=here.estimate, accurate=here.accurate)
    return wearing.at_followed(wearing.with_rates(state))


def vibrates_otherwise(state: WearState) -> bool:
    """Whether the vibration differs from the vibration of the last stability check."""
    if state.judged_h.shape != state.at.predicted_h.shape:
        return True
    before, now = state.judged_h[:, 1:], state.at.predicted_h[:, 1:]
    return float(np.linalg.norm(now - before)) > VIBRATION_RECHECK * float(np.linalg.norm(before))


def unstable_at_end(wearing: WearingJoint, state: WearState) -> Failure | None:
    """Instability of the last state of a history, None if stable; INACCURATE where its stability, or that of the start
    state, which the sweep has judged already, is not known.
    """
    unknown = Failure(Outcome.INACCURATE, wearing.start.unjudged) if wearing.start.unjudged else None
    if state.cycle == 0.0 and wearing.follow is None and not vibrates_otherwise(state):
        return unknown
    case, joint = wearing.case_and_joint(state)
    # the determinant of a joint that is free to slide is zero, and its sign is round-off
    if free_slide(joint, state.at) is None and not wearing.run.is_stable(joint, state.at):
        said = f"at cycle {in_digits(state.cycle)} a small disturbance grows and keeps its sign, as between two folds"
        return Failure(Outcome.UNSTABLE, said)
    return find_instability(case, joint, state.at, wearing.run, True) or unknown
