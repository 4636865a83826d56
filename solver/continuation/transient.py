"""Where the structure settles: the harmonics of its motion followed in time from a given motion to a periodic one.

The motion is y(t) = Re sum Y_n(T) exp(i n w t) with amplitudes that vary slowly, so that d/dt acts on Y_n as
i n w + d/dT. With the velocity V = (i n w + d/dT) Y as a state of its own, the equation of motion reads

    M (i n w + d/dT) V + C V + K Y + lambda = F,

and an implicit Euler step of length D in T from (Y_0, V_0), with s = i n w + 1/D, gives V = s Y - Y_0 / D and

    (K + s C + s^2 M) Y + lambda = F + M (s Y_0 + V_0) / D + C Y_0 / D.

This is the harmonic balance again, with other matrices and loads: it is condensed on the contact pairs and solved by
the same Newton's method. A motion that repeats (V_0 = i n w Y_0, Y = Y_0) fulfils the balance exactly, whatever D, and
D -> infinity is that balance. Friction is closed over one period with the history of the step before. The static
harmonic is no exception, with s = 1/D.

A short step follows the transient of the structure, a long one damps all that decays; growing motions leave an unstable
state as long as 1/D exceeds their rate, so D starts at one period and the state found last is tested.
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from typing import Any, cast

import numpy as np

from solver.harmonic_balance.converged import PathPoint, final_history
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.model import ComplexArray, FloatArray, Matrix
from solver.newton.linear_solver import JacobianSolver
from solver.newton.solve_balance import Effort, solve_balance
from solver.outcome import Outcome
from solver.stability.hill import is_stable
from solver.structure.condensation import CondensedStructure, condense, relative_indices
from solver.structure.fourier import from_complex, to_complex
from solver.structure.joint import Case, Joint

MOST_STEPS = 120
MOST_FAILURES = 60  # steps that did not converge or changed too much
ADRIFT = 1e3  # mean relative displacement over the largest one that vibration and start show
SHORTEST = 1.0 / 64.0  # periods
LONGEST = 1e9  # periods
WANTED = 0.25  # relative change of the motion over a step
LARGEST = 0.6  # relative change over a step that is not divided
SETTLED = 0.02  # relative change over a step from which the periodic state is sought
NEAR = 0.1  # of the motion: farther from where the motion has settled, a periodic state is another one
STEP_TOLERANCE = 1e-6  # of the scaled residual of a step, which is no result


@dataclass(frozen=True)
class Motion:
    """Amplitudes (1 + H, n) of all displacements, m, and velocities, m/s; the static harmonic first."""

    displacement: ComplexArray
    velocity: ComplexArray


@dataclass(frozen=True)
class _CarriedStructure(CondensedStructure):
    """A structure under a load in all harmonics, carried_h (n_rel, 2H+1), N."""

    carried_h: FloatArray

    def force_h(self) -> FloatArray:
        return self.carried_h


class Transient:
    """Matrices and loads of a case at one frequency and load, for steps in time."""

    def __init__(self, case: Case, joint: Joint) -> None:
        self.joint = joint
        self.relative, _ = relative_indices(case.model.contact)
        orders = (0, *joint.basis.orders)
        self.rates = 1j * joint.omega * np.array(orders)
        self.parts: list[tuple[Matrix, Matrix, Matrix, Matrix]] = []
        for order in orders:
            linear, conjugate = (case.model.linear[0], False) if order == 0 else case.model.harmonic_structure(order)
            load: Matrix = np.zeros(linear.mass.shape[0])
            if order == 0:
                load = linear.load_static
            elif order == 1:
                load = joint.excitation_amplitude * linear.load_harmonic
            mass, damping, stiffness = (
                np.real(part) if order == 0 else part.conj() if conjugate else part
                for part in (linear.mass, linear.damping, linear.stiffness)
            )
            self.parts.append((mass, damping, stiffness, load.conj() if conjugate else load))

    def periodic(self, evaluation: Evaluation) -> Motion:
        """Motion whose relative displacements are those of a periodic state of this joint."""
        return self._motion(evaluation, self.rates, [load for *_, load in self.parts], None, 0.0)

    def rest(self) -> Motion:
        """No displacement, no velocity."""
        none = np.zeros((len(self.parts), self.parts[0][0].shape[0]), complex)
        return Motion(none, none)

    def resumed(self, motion: Motion) -> Motion:
        """A periodic motion of another joint (another frequency or load) taken up by this one."""
        return Motion(motion.displacement, self.rates[:, None] * motion.displacement)

    def step(self, before: Motion, inverse: float) -> Joint:
        """Joint whose balance is an implicit Euler step of length 1/`inverse`, s, from a motion."""
        orders = len(self.parts)
        n_rel = self.relative.size
        stiffness = np.empty((orders, n_rel, n_rel), complex)
        force = np.empty((orders, n_rel), complex)
        for place, load in enumerate(self._loads(before, inverse)):
            condensed = condense(self._full(place, self.rates[place] + inverse), self.relative, load)
            stiffness[place], force[place] = condensed.stiffness, condensed.force
        plain = self.joint.structure
        kept: dict[str, Any] = {field.name: getattr(plain, field.name) for field in fields(plain)}
        kept["static_stiffness"] = np.real(stiffness[0])
        kept["dynamic_stiffness"] = stiffness[1:]
        carried = from_complex(np.real(force[0]), force[1:].T)
        return replace(self.joint, structure=_CarriedStructure(**kept, carried_h=carried))

    def after(self, evaluation: Evaluation, before: Motion, inverse: float) -> Motion:
        """Motion at the end of such a step, from the state that its balance has."""
        return self._motion(
            evaluation, np.asarray(self.rates + inverse, np.complex128), self._loads(before, inverse), before, inverse
        )

    def _full(self, place: int, rate: complex) -> Matrix:
        mass, damping, stiffness, _ = self.parts[place]
        return cast("Matrix", stiffness + rate * damping + rate**2 * mass)

    def _loads(self, before: Motion, inverse: float) -> list[Matrix]:
        loads: list[Matrix] = []
        for place, (mass, damping, _, load) in enumerate(self.parts):
            moved, velocity = before.displacement[place], before.velocity[place]
            carried = mass @ ((self.rates[place] + inverse) * moved + velocity) + damping @ moved
            loads.append(load + inverse * carried)
        return loads

    def _motion(
        self, evaluation: Evaluation, rates: ComplexArray, loads: list[Matrix], before: Motion | None, inverse: float
    ) -> Motion:
        relative_h = self.joint.to_relative(evaluation.displacement_h)
        amplitudes = np.concatenate([relative_h[:, :1].astype(complex), to_complex(relative_h)], axis=1)
        displacement = np.array(
            [
                condensed.motion @ amplitudes[:, place] + condensed.held_motion
                for place, condensed in enumerate(
                    condense(self._full(place, rates[place]), self.relative, load) for place, load in enumerate(loads)
                )
            ]
        )
        velocity = rates[:, None] * displacement
        return Motion(displacement, velocity if before is None else velocity - inverse * before.displacement)


def settle(
    case: Case,
    joint: Joint,
    wear_depth: FloatArray,
    start: Evaluation,
    start_joint: Joint,
    history: FloatArray,
    solver: JacobianSolver,
    effort: Effort,
) -> tuple[Outcome, PathPoint | None]:
    """Stable state of `joint` that the structure settles to from a state of `start_joint`, or why there is none.

    wear_depth (n_contact,): m, held fixed. history (n_contact, 2): m, tangential history at the start. Both joints
    have the same pairs and harmonics; frequency and load may differ: the start without excitation finds the state that
    builds up from rest. At most `MOST_STEPS` steps in time. The parameter of the point is NaN.

    ADRIFT: a joint that slips all over forgets where it was, and nothing but friction may hold its parts; where their
    mean position runs away there is no periodic state. START_FAILED: no stable state was found otherwise.
    """
    transient = Transient(case, joint)
    motion = transient.resumed(Transient(case, start_joint).periodic(start))
    predicted = start.predicted_h
    period = 2.0 * np.pi / joint.omega
    length, tried, failures = 1.0, np.inf, 0
    size = float(np.abs(start.displacement_h).max())
    for _ in range(MOST_STEPS):
        inverse = 1.0 / (length * period)
        balance = Balance.frozen(transient.step(motion, inverse), history, wear_depth)
        tolerance = max(STEP_TOLERANCE, case.settings.tolerance)
        result = solve_balance(balance, predicted, solver, tolerance, effort, 12)
        ahead = transient.after(result.evaluation, motion, inverse) if result.converged else motion
        change = _change(motion, ahead)
        if not result.converged or (change > LARGEST and length > 1.0):
            length *= 0.35
            failures += 1
            if length < SHORTEST or failures > MOST_FAILURES:
                break
            continue
        motion, predicted = ahead, result.evaluation.predicted_h
        history = final_history(balance, result.evaluation)
        moved = np.abs(result.evaluation.displacement_h)
        size = max(size, float(moved[:, :, 1:].max()))
        if moved[:, :, 0].max() > ADRIFT * size:
            return Outcome.ADRIFT, None
        # not again until the motion has calmed further: Newton's method from a motion that still moves is lost work
        if change < SETTLED and (change < 0.3 * tried or length >= LONGEST):
            tried = change
            found = _periodic(case, joint, wear_depth, predicted, history, solver, effort)
            if found is not None and _change(transient.periodic(found.evaluation), motion) < NEAR:
                return Outcome.CONVERGED, found
        elif change > SETTLED:
            tried = np.inf
        # amplitudes have no meaning over less than a period: only where Newton's method fails are steps shorter
        length = min(max(length * float(np.clip(WANTED / max(change, 1e-300), 0.5, 2.5)), 1.0), LONGEST)
    return Outcome.START_FAILED, None


def _periodic(
    case: Case,
    joint: Joint,
    wear_depth: FloatArray,
    predicted: FloatArray,
    history: FloatArray,
    solver: JacobianSolver,
    effort: Effort,
) -> PathPoint | None:
    """Stable periodic state from a motion that has settled."""
    balance = Balance.frozen(joint, history, wear_depth)
    result = solve_balance(balance, predicted, solver, case.settings.tolerance, effort, 10)
    if not result.converged or not is_stable(balance.linearise(result.evaluation), solver):
        return None
    return PathPoint(float("nan"), result.evaluation, final_history(balance, result.evaluation))


def _change(before: Motion, after: Motion) -> float:
    """Change of the vibration over the larger one of both."""
    one, other = before.displacement[1:], after.displacement[1:]
    size = max(float(np.linalg.norm(one)), float(np.linalg.norm(other)))
    return float(np.linalg.norm(other - one)) / size if size > 0.0 else 0.0
