"""How wrong a state is for its harmonics and samples, and which of them it needs.

The error of a state is estimated by solving it again with more harmonics and with more samples, each warm started: what
changes is the error, up to the rest of the series (`solver.accuracy.level`). Automatic settings go up, one or the
other, until the estimate is below `rtol`; a state without even harmonics goes on without them, and one in which nothing
slips or opens keeps the first harmonic alone, which is then exact. Masses that ratchet are brought to rest first
(`solver.continuation.ratcheting`), and where Newton's method diverges from a warm start with more harmonics these are
added by homotopy (`solver.continuation.harmonic_homotopy`), as far as that is cheap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.accuracy.error_estimate import NOTHING, Estimate
from solver.accuracy.harmonic_levels import room_for, shifted
from solver.accuracy.level import Level
from solver.accuracy.options import ACCURACY
from solver.accuracy.period_events import nothing_happens
from solver.harmonic_balance.converged import PathPoint
from solver.newton.options import NEWTON
from solver.newton.solve_balance import Effort
from solver.settings import Resolution
from solver.structure.joint import Case, Joint


@dataclass(frozen=True)
class Refined:
    """A state with the harmonics and samples that it needs, or as many as there may be.

    case: with the resolution of the state. point: the state; its parameter is that of the point refined. estimate: of
    its errors. accurate: whether it is below rtol (that of the response, where only the finest samples show any slip);
    for fixed settings always true.
    """

    case: Case
    point: PathPoint
    estimate: Estimate
    accurate: bool


def refine(
    case: Case,
    omega: float,
    excitation_amplitude: float,
    point: PathPoint,
    effort: Effort,
    most: float = ACCURACY.most_unknowns,
    usual_work: float = 0.0,
) -> Refined:
    """Estimate the error of a state (its wear held) and, with automatic settings, refine it until that is below rtol.

    Parameters
    ----------
    case
        With the harmonics and samples of the state.
    omega, excitation_amplitude
        rad/s, N.
    point
        The state.
    effort
        Newton iterations spent are added to it.
    most
        Unknowns of a joint of 48 pairs up to which more harmonics are taken (`room_for`).
    usual_work
        N m, slip work against which a smaller one is judged: next to none has no relative error to speak of.

    Returns
    -------
    Refined
        The state as it was, with its error, where no accurate one is found.

    Raises
    ------
    OutOfTimeError
        Behind the deadline of the effort.
    """
    settings = case.settings
    here = Level(case, case.joint(omega, excitation_amplitude), point, usual_work)
    here = here.at_rest(effort)
    begun = effort.iterations
    faint = False
    richer: Level | None = None
    while True:
        if nothing_happens(here.point.evaluation):
            if settings.harmonics == "auto" and here.case.resolution.orders != (1,):
                first = here.solve_at(Resolution((1,), here.case.resolution.samples), effort)
                here = first or here
            missed = here.missed_event(effort)
            if missed is None:
                return Refined(here.case, here.point, NOTHING, True)
            if settings.samples != "auto":
                missing = here.difference(missed).times(ACCURACY.double_samples_safety)
                accurate = not settings.automatic or missing.largest <= settings.rtol
                return Refined(here.case, here.point, missing, accurate)
            here, faint = missed, True
            continue
        if settings.harmonics == "auto":
            here = here.without_even(effort) or here.with_even(effort) or here
        resolution = here.case.resolution
        by_samples, finer = here.samples_error(effort)
        by_harmonics, richer = here.harmonics_error(effort, richer)
        above = shifted(resolution, 1)
        cheap = here.unknowns(above) <= ACCURACY.dear_unknowns and _allowed(here, above, most)
        if richer is None and settings.harmonics == "auto" and cheap:
            # impacts: Newton's method diverges from a warm start with more harmonics, though they have the state
            richer = here.by_homotopy(above, effort)
            by_harmonics = by_harmonics if richer is None else here.difference(richer).times(ACCURACY.one_level_safety)
        estimate = by_samples + by_harmonics
        if not settings.automatic:
            known = estimate if np.isfinite(estimate.largest) else Estimate(np.nan, np.nan)
            return Refined(here.case, here.point, known, True)
        holds = here.holds()
        if estimate.largest <= ACCURACY.aim * settings.rtol and holds:
            here, estimate = here.relaxed(estimate, effort)
            return Refined(here.case, here.point, estimate, True)
        more_samples = settings.samples == "auto" and by_samples.largest > by_harmonics.largest / ACCURACY.error_ratio
        lacks_harmonics = not holds or by_harmonics.largest > by_samples.largest / ACCURACY.error_ratio
        more_harmonics = settings.harmonics == "auto" and lacks_harmonics
        wanted = resolution
        if more_harmonics:
            wanted = above if settings.samples == "auto" else Resolution(above.orders, resolution.samples)
        if more_samples:
            wanted = Resolution(wanted.orders, 2 * resolution.samples)
        next_level = None
        few = here.unknowns(shifted(resolution, 2)) <= ACCURACY.cheap_unknowns
        limit = begun + (ACCURACY.cheap_refinement_iterations if few else ACCURACY.refinement_iterations)
        if wanted != resolution and _allowed(here, wanted, most) and effort.iterations < limit:
            if finer is not None and finer.case.resolution == wanted:
                next_level = finer
            elif richer is not None and richer.case.resolution == wanted:
                next_level = richer
            else:
                next_level = here.solve_at(wanted, effort)
            if next_level is None and richer is not None and richer.case.resolution.highest > wanted.highest:
                # what is not found from below may be found from above
                next_level = richer.solve_at(wanted, effort)
            if next_level is None and settings.harmonics == settings.samples and richer is not None:
                next_level = richer if _allowed(here, richer.case.resolution, most) else None
        if next_level is None:
            # slip that few samples see is no reason to give up a motion that is known
            judged = estimate.response if faint else estimate.largest
            return Refined(here.case, here.point, estimate, judged <= settings.rtol)
        here = next_level


def state_difference(case: Case, joint: Joint, one: PathPoint, other: PathPoint) -> Estimate:
    """Relative differences of response and wear rate of two states of one joint, judged like any error."""
    return Level(case, joint, one).difference(Level(case, joint, other))


def _allowed(here: Level, resolution: Resolution, most_unknowns: float) -> bool:
    """Whether "auto" may go on with these harmonics and samples."""
    if not here.case.model.holds(resolution.highest):
        return False
    n_rel = here.joint.component_index.size
    # what the pairs take at all samples, in all harmonics
    if here.unknowns(resolution) * resolution.samples > ACCURACY.samples_of_unknowns * room_for(most_unknowns, n_rel):
        return False
    small = n_rel <= NEWTON.small_joint_displacements
    most = room_for(min(most_unknowns, ACCURACY.few_pairs_unknowns) if small else most_unknowns, n_rel)
    if resolution.highest > ACCURACY.most_mixed_harmonics:
        # friction alone: motions that hit something take more in vain
        if not all(order % 2 for order in resolution.orders):
            return False
        most = min(most, ACCURACY.dear_unknowns)
    # two levels more are left to compare with
    in_levels = resolution.highest <= ACCURACY.harmonic_levels[-3]
    return resolution.samples <= ACCURACY.most_samples and in_levels and here.unknowns(resolution) <= most
