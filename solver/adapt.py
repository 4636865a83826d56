"""How wrong a state is for its harmonics and samples, and which of them it needs.

The error of a state is estimated by solving it again with more harmonics and with more samples, each warm started: what
changes is the error, up to the rest of the series (`SAFETY`). Automatic settings go up, one or the other, until the
estimate is below `rtol`; a state that carries no even harmonics goes on without them, and one in which nothing slips
or opens keeps the first harmonic alone, which is then exact. Masses that creep are brought to rest first (`creep`), and
where a warm start with more harmonics is thrown off the state is led to them (`enrich`), as far as that is cheap.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.balance import Balance, Evaluation
from solver.certificate import certify
from solver.creep import creeps, rest_masses
from solver.enrich import lead_to, start_with_tail
from solver.estimate import NOTHING, UNKNOWN, Estimate
from solver.factor import FEW_ROWS
from solver.harmonics import change_orders, to_complex
from solver.joint import Case, Joint
from solver.ladder import LADDER, fewer, on_ladder, steps_to_see
from solver.linear import JacobianSolver
from solver.model import ComplexArray, FloatArray
from solver.path import Effort, PathPoint, final_history, solve_balance
from solver.period import half_wave_symmetric, nothing_happens, shortest_contact
from solver.settings import Resolution

MOST_SAMPLES = 8192
SEEN_SAMPLES = 2048  # a sine overtops a limit unseen by 1e-6 of its size then
MOST_CHEAP = 600  # the same while the unknowns are few: solves that fail take most of them, and little time
MOST_LEADS = 5  # ways to more harmonics in one refinement
MOST_ITERATIONS = 40  # of a solve from the state with other harmonics
MOST_REFINEMENT = 200  # iterations of one refinement in all
FEW_ITERATIONS = 30  # where they are dear
DEAR = 1000  # unknowns
MOST_UNKNOWNS = 8000  # of a balance that "auto" may march with
MOST_FAR = 200  # of a balance that is solved to see a short contact
MOST_OF_FEW = 2000  # where the pairs are few: impacts couple all harmonics, and no preconditioner helps
MOST_COMPARED = 12000  # of a balance that is solved to estimate an error
HARMONICS_SAFETY = 1.5  # where the error falls as 1/H to 1/H^3 it is 2 to 1.2 times the difference to two steps up
NEAR_SAFETY = 2.5  # and 3.4 to 1.5 times that to one step up
SAMPLES_SAFETY = 1.5  # the error falls with the time between samples or its square: 2 to 1.3 times the difference
SCATTER_SAFETY = 2.0  # 1.5 to 1.1 times that to three times as many, but those of single events scatter
SMALL_WORK = 0.001  # of the work of the excitation: where normal force times slip is less, it is judged against this
SMALL_WORK_DEAR = 0.01  # the same where the unknowns are many
NO_WORK = 1e-3  # of this: where even that is not reached, nothing wears
CREEP = 0.1  # of rtol: share of the slip work that may be creep
SMALL_RESPONSE = 1e-5  # of what the excitation would cause on the stiffness of the joint alone
AIM = 0.8  # of rtol: an estimate is one within a factor
SPARE = 0.3  # of what is enough: a state so accurate is tried with fewer


@dataclass(frozen=True)
class Refined:
    """A state with the harmonics and samples that it needs, or as many as there may be.

    case: with the resolution of the state. point: the state; its parameter is that of the point refined. estimate: of
    its errors. accurate: whether it is below rtol (that of the response, where only the finest samples show any slip);
    for fixed settings always true. spare: whether fewer might do.
    """

    case: Case
    point: PathPoint
    estimate: Estimate
    accurate: bool


def refine(case: Case, omega: float, excitation_amplitude: float, point: PathPoint, effort: Effort) -> Refined:
    """Estimate the error of a state (its wear held) and, with automatic settings, refine it until that is below rtol.

    omega: rad/s. excitation_amplitude: N.
    """
    settings = case.settings
    here = _Level(case, case.joint(omega, excitation_amplitude), point)
    here = here.at_rest(effort)
    begun = effort.iterations
    leads, faint = MOST_LEADS, False
    while True:
        if nothing_happens(here.point.evaluation):
            if settings.harmonics == "auto" and here.case.resolution.orders != (1,):
                first = here.solve_at(Resolution((1,), here.case.resolution.samples), effort)
                here = first or here
            missed = here.missed_event(effort)
            if missed is None:
                return Refined(here.case, here.point, NOTHING, True)
            if settings.samples != "auto":
                missing = here.difference(missed).times(SAMPLES_SAFETY)
                accurate = not settings.automatic or missing.largest <= settings.rtol
                return Refined(here.case, here.point, missing, accurate)
            here, faint = missed, True
            continue
        if settings.harmonics == "auto":
            here = here.without_even(effort) or here
        resolution = here.case.resolution
        by_samples, finer = here.samples_error(effort)
        by_harmonics, richer = here.harmonics_error(effort)
        above = on_ladder(resolution, 1)
        cheap = here.unknowns(above) <= DEAR and _allowed(here, above)
        if richer is None and settings.harmonics == "auto" and leads and cheap:
            # impacts: a warm start with more harmonics is thrown off, though they have the state
            leads -= 1
            richer = here.led_to(above, effort)
            by_harmonics = by_harmonics if richer is None else here.difference(richer).times(NEAR_SAFETY)
        estimate = by_samples + by_harmonics
        if not settings.automatic:
            known = estimate if np.isfinite(estimate.largest) else Estimate(np.nan, np.nan)
            return Refined(here.case, here.point, known, True)
        holds = here.holds()
        if estimate.largest <= AIM * settings.rtol and holds:
            here, estimate = here.relaxed(estimate, effort)
            return Refined(here.case, here.point, estimate, True)
        more_samples = settings.samples == "auto" and by_samples.largest > by_harmonics.largest / 3.0
        more_harmonics = settings.harmonics == "auto" and (not holds or by_harmonics.largest > by_samples.largest / 3.0)
        wanted = resolution
        if more_harmonics:
            higher = above
            wanted = higher if settings.samples == "auto" else Resolution(higher.orders, resolution.samples)
        if more_samples:
            wanted = Resolution(wanted.orders, 2 * resolution.samples)
        next_level = None
        most = begun + (MOST_CHEAP if here.unknowns(on_ladder(resolution, 2)) <= DEAR else MOST_REFINEMENT)
        if wanted != resolution and _allowed(here, wanted) and effort.iterations < most:
            if finer is not None and finer.case.resolution == wanted:
                next_level = finer
            elif richer is not None and richer.case.resolution == wanted:
                next_level = richer
            else:
                next_level = here.solve_at(wanted, effort)
            if next_level is None and settings.harmonics == settings.samples and richer is not None:
                next_level = richer if _allowed(here, richer.case.resolution) else None
        if next_level is None:
            # slip that few samples see is no reason to give up a motion that is known
            judged = estimate.response if faint else estimate.largest
            return Refined(here.case, here.point, estimate, judged <= settings.rtol)
        here = next_level


def lighter(refined: Refined, omega: float, excitation_amplitude: float, most: int, effort: Effort) -> Refined | None:
    """The same state with so few harmonics that it has at most so many unknowns; None where there is none."""
    here = _Level(refined.case, refined.case.joint(omega, excitation_amplitude), refined.point)
    while here.joint.slots.size * (2 * len(here.case.resolution.orders) + 1) > most:
        lower = fewer(here.case.resolution, here.case.settings)
        level = here.solve_at(lower, effort) if lower != here.case.resolution else None
        if level is None:
            return None
        here = level
    return Refined(here.case, here.point, UNKNOWN, False)


def state_difference(case: Case, joint: Joint, one: PathPoint, other: PathPoint) -> Estimate:
    """Relative differences of response and wear rate of two states of one joint, judged like any error."""
    return _Level(case, joint, one).difference(_Level(case, joint, other))


def transfer(
    case: Case, joint: Joint, evaluation: Evaluation, old_orders: tuple[int, ...]
) -> tuple[Balance, FloatArray]:
    """Balance and predicted force (n_rel, m), N, from which a state of other harmonics is solved in this case."""
    balance = Balance(joint, evaluation.history, evaluation.wear_depth, np.zeros_like(evaluation.wear_depth))
    orders = case.resolution.orders
    return balance, balance.predict(
        change_orders(evaluation.displacement_h, old_orders, orders),
        change_orders(evaluation.force_h, old_orders, orders),
    )


@dataclass(frozen=True)
class _Level:
    """A state with the case that it was solved in."""

    case: Case
    joint: Joint
    point: PathPoint

    def solve_at(self, resolution: Resolution, effort: Effort) -> _Level | None:
        """The same state with other harmonics and samples; None where it is not found."""
        return self._transferred(self.case, self.point.evaluation, resolution, effort)

    def unknowns(self, resolution: Resolution) -> int:
        """Unknowns of the balance with other harmonics."""
        return self.joint.slots.size * (2 * len(resolution.orders) + 1)

    def may_look_at(self, resolution: Resolution) -> bool:
        """Whether a state of so many more harmonics is so cheap that it may be asked what these miss."""
        return self.unknowns(resolution) <= MOST_FAR and self.case.model.holds(resolution.highest)

    def led_to(self, resolution: Resolution, effort: Effort) -> _Level | None:
        """The same state with more harmonics, these raised from nothing; None where that way ends."""
        if 2 * resolution.highest < self.case.resolution.samples:
            case = self.case.at(resolution)
            joint = case.joint(self.joint.omega, self.joint.excitation_amplitude)
            level = self._solved(
                case, joint, *start_with_tail(joint, self.point.evaluation, self.case.resolution.orders), effort
            )
            if level is not None:
                return level
        led = lead_to(self.case, self.joint, self.point.evaluation, resolution, effort)
        if led is None:
            return None
        return self._transferred(replace(self.case, resolution=resolution), led, resolution, effort)

    def _transferred(self, old: Case, evaluation: Evaluation, resolution: Resolution, effort: Effort) -> _Level | None:
        """State found from one with other harmonics or with the penalty of another case."""
        case = self.case.at(resolution)
        joint = case.joint(self.joint.omega, self.joint.excitation_amplitude)
        return self._solved(case, joint, *transfer(case, joint, evaluation, old.resolution.orders), effort)

    def _solved(self, case: Case, joint: Joint, balance: Balance, start: FloatArray, effort: Effort) -> _Level | None:
        most = MOST_ITERATIONS if start.size <= DEAR else FEW_ITERATIONS
        result = solve_balance(balance, start, JacobianSolver(), case.settings.tolerance, effort, most)
        if not result.converged:
            return None
        point = PathPoint(self.point.parameter, result.evaluation, final_history(balance, result.evaluation))
        # the mean position of a mass depends a little on the harmonics
        return _Level(case, joint, point).at_rest(effort)

    def at_rest(self, effort: Effort) -> _Level:
        """The same state with its marched masses at rest: what they creep is slip and would be taken for wear."""
        settings = self.case.settings
        share = CREEP * settings.rtol
        if not creeps(self.joint, self.point.evaluation, share):
            return self
        rested = rest_masses(self.joint, self.point, share, settings.tolerance, effort)
        return _Level(self.case, self.joint, rested)

    def least_work(self) -> float:
        """Slip work, N m, below which a relative error of it weighs less: a share of what the excitation does."""
        motion = self.joint.to_relative(self.point.evaluation.displacement_h)
        cheap = self.unknowns(self.case.resolution) <= DEAR
        return (SMALL_WORK if cheap else SMALL_WORK_DEAR) * abs(self.joint.structure.input_work(motion))

    def without_even(self, effort: Effort) -> _Level | None:
        """The same state without its even harmonics, where it has none; None where it needs them or has them not."""
        orders = self.case.resolution.orders
        odd = tuple(order for order in orders if order % 2)
        if odd == orders or not half_wave_symmetric(self.point.evaluation):
            return None
        return self.solve_at(Resolution(odd, self.case.resolution.samples), effort)

    def missed_event(self, effort: Effort) -> _Level | None:
        """The same state with as many samples as it takes to see a pair slip or open, or the contact be made, between
        the samples; None where nothing does. Harmonics without an event in between are exact: one look is enough.
        """
        orders, samples = self.case.resolution.orders, self.case.resolution.samples
        finest = self.solve_at(Resolution(orders, max(SEEN_SAMPLES, 2 * samples)), effort)
        if finest is None or nothing_happens(finest.point.evaluation):
            return None
        while (samples := 2 * samples) < finest.case.resolution.samples:
            level = self.solve_at(Resolution(orders, samples), effort)
            if level is not None and not nothing_happens(level.point.evaluation):
                return level
        return finest

    def samples_error(self, effort: Effort) -> tuple[Estimate, _Level | None]:
        """Estimated error for want of samples, and the state with more of them that it comes from.

        What is wrong is where in its step an event falls. A sample next to an extreme is also among twice as many and
        may still be the one next to it: then both states are wrong by the same. So the others lie in between: three
        times as many and two, which have only the phases 0 and pi in common with these. Where the unknowns are many so
        are the events, and twice as many samples, with which the refinement can go on, tell enough. Where no state is
        found it is the difference to the one with half as many, which is at least as large.
        """
        orders, samples = self.case.resolution.orders, self.case.resolution.samples
        few = self.unknowns(self.case.resolution) <= DEAR
        finer = self.solve_at(Resolution(orders, 3 * samples + 2 if few else 2 * samples), effort)
        if finer is not None:
            return self.difference(finer).times(SCATTER_SAFETY if few else SAMPLES_SAFETY), finer
        coarser = self.solve_at(Resolution(orders, samples // 2), effort) if samples // 2 > 2 * orders[-1] else None
        return (UNKNOWN if coarser is None else coarser.difference(self)), None

    def harmonics_error(self, effort: Effort) -> tuple[Estimate, _Level | None]:
        """Estimated error for want of harmonics, and the state with more of them that it comes from.

        It is the difference to the state two steps up the ladder; where that is not found, takes too many unknowns, or
        the scene does not hold the nodal diameters of so many, one step; where not even those, to the state one step
        down, which is larger. As far as that is cheap it is the difference to a state that sees the shortest contact,
        and where none such is found the error is unknown, whatever the other states say.
        """
        contact = shortest_contact(self.point.evaluation.status_t)
        # a whole period of the highest harmonic in the contact shows it well, half a period shows it
        far, seeing = (steps_to_see(self.case.resolution, share * contact, 2) for share in (0.5, 1.0))
        while far > 2 and not self.may_look_at(on_ladder(self.case.resolution, far)):
            far -= 1
        seeing = min(seeing, far)
        for steps in sorted({far, seeing, 2, 1, -1}, reverse=True):
            other = on_ladder(self.case.resolution, steps)
            affordable = self.unknowns(other) <= MOST_COMPARED
            if other.highest != self.case.resolution.highest and self.case.model.holds(other.highest) and affordable:
                level = self.solve_at(other, effort)
                if level is not None:
                    richer = level if steps > 0 else None
                    if steps < seeing and seeing > 2:
                        return UNKNOWN, richer
                    return self.difference(level).times(NEAR_SAFETY if steps == 1 else HARMONICS_SAFETY), richer
        return UNKNOWN, None

    def relaxed(self, estimate: Estimate, effort: Effort) -> tuple[_Level, Estimate]:
        """The same state with as few harmonics and samples as it needs, and its estimated errors; `estimate`: of this.

        Half of rtol is kept, so that the next state does not go up again at once.
        """
        here, enough = self, 0.5 * self.case.settings.rtol
        while estimate.largest <= SPARE * enough:
            lower = fewer(here.case.resolution, here.case.settings)
            level = here.solve_at(lower, effort) if lower != here.case.resolution else None
            if level is None:
                break
            larger = level.difference(here).times(HARMONICS_SAFETY) + estimate
            if larger.largest > enough or not level.holds():
                break
            here, estimate = level, larger
        return here, estimate

    def response(self) -> ComplexArray:
        """First harmonic of the responses (n_response,), m."""
        structure = self.joint.structure
        return to_complex(structure.response_h(self.joint.to_relative(self.point.evaluation.displacement_h)))[:, 0]

    def least_response(self) -> float:
        """Response, m, below which a relative error says nothing: a small share of what the excitation would cause on
        the joint's own stiffness. A mass that its friction holds does not respond at all.
        """
        structure, penalty = self.joint.structure, self.joint.penalty
        stiffness = np.stack([penalty.normal, penalty.tangential, penalty.tangential], axis=1).ravel()
        moved = structure.harmonic_force / stiffness[self.joint.slots]
        response = np.abs(structure.dynamic_response[0]) @ np.abs(moved) + np.abs(structure.harmonic_offset)
        return max(SMALL_RESPONSE * float(np.linalg.norm(response)), 1e-300)

    def holds(self) -> bool:
        """Whether the certificate of the state holds."""
        return certify(self.joint, self.point.evaluation).holds(self.case.settings.tolerance)

    def difference(self, better: _Level) -> Estimate:
        """Relative differences of response and wear rate to a better state."""
        mine, its = self.response(), better.response()
        response = float(np.linalg.norm(mine - its)) / max(float(np.linalg.norm(its)), better.least_response())
        mine_slip, its_slip = (float(level.point.evaluation.slip_work.sum()) for level in (self, better))
        least = max(self.least_work(), better.least_work())
        if max(its_slip, mine_slip) <= NO_WORK * least:
            return Estimate(response, 0.0)
        # no wear rate is surer than the motion that it comes from
        size = max(its_slip, NO_WORK * least)
        return Estimate(response, max(response, abs(mine_slip - its_slip) / size), size / max(size, least))


def _allowed(here: _Level, resolution: Resolution) -> bool:
    if not here.case.model.holds(resolution.highest):
        return False
    most = MOST_OF_FEW if here.joint.slots.size <= FEW_ROWS else MOST_UNKNOWNS
    return resolution.samples <= MOST_SAMPLES and resolution.highest <= LADDER[-3] and here.unknowns(resolution) <= most
