"""Relaxation in time to a periodic state: the harmonics of the motion vary slowly until they are constant.

In the motion y(t) = Re sum Y_n(T) exp(i n w t) the derivative d/dt acts on Y_n as i n w + d/dT. An implicit Euler step
of length D in T from amplitudes Y_0 and velocities V_0, with s = i n w + 1/D, gives V = s Y - Y_0 / D and

    (K + s C + s^2 M) Y + lambda = F + M (s Y_0 + V_0) / D + C Y_0 / D,

the harmonic balance, Eq. (8), with other matrices and loads; for D -> infinity the balance itself. A periodic motion
fulfils the equation for each D. The friction law is periodic and starts from the history of the step before.

A short step resolves the transient, a long step damps all decaying motions. Growing motions leave an unstable state as
long as 1/D exceeds their rate, which the determinant of the step shows. So D starts at one period, each periodic state
is tested for stability, and D is bounded by this rate once a state was unstable.
"""

from dataclasses import dataclass, replace

import numpy as np

from solver.continuation.natural import NEAR_ITERATIONS, SMALL_CHANGE, SMOOTH_CHANGE
from solver.harmonic_balance.dlft import Balance, Evaluation
from solver.harmonic_balance.state import Failure, State
from solver.model import ComplexArray, FloatArray
from solver.newton.run import SHORTEST_STEP, Run
from solver.outcome import Outcome
from solver.settings import ROUND_OFF
from solver.structure.condensation import condensed_at, whole_motion
from solver.structure.fourier import from_complex, with_static
from solver.structure.joint import Joint, held
from solver.structure.ring_motion import motion_of

TRANSIENT_CUT = 0.35
"""Factor of the length of a refused step. Half the value takes 2.5 times the iterations of a jump at a fold; with 0.25
vibro-impact takes 15 % more, and a free block that lifts off is found adrift, with 0.35 unsettled."""

SEARCH_ITERATIONS = 800
"""Most Newton iterations of a relaxation. A jump at a fold of vibro-impact takes 400 to 500; a block that does not
settle ends after 600 to 740 by its steps."""

RUNAWAY = 1e3
"""Displacement over the largest one of vibration and start; above it parts run away."""


@dataclass(frozen=True)
class Motion:
    """Amplitudes (1 + H, n) of all displacements, m, and velocities, m/s; the static harmonic first."""

    displacement: ComplexArray
    velocity: ComplexArray


class Transient:
    """Matrices and loads of a joint for steps in time."""

    def __init__(self, joint: Joint) -> None:
        self.joint, orders = joint, np.array((0, *joint.basis.orders))
        self.relative = joint.contact.relative
        self.rates: ComplexArray = 1j * joint.omega * orders
        self.linear = [joint.model.harmonic_structure(order) for order in orders.tolist()]
        self.loads: ComplexArray = np.zeros((orders.size, len(self.linear[0].load_static)), complex)
        self.loads[0] = self.linear[0].load_static
        self.loads[orders == 1] = joint.excitation_amplitude * joint.model.harmonic_structure(1).load_harmonic

    def periodic(self, evaluation: Evaluation) -> Motion:
        """Motion of the whole structure in a periodic state of the joint: the end of an infinite step."""
        nothing = np.zeros_like(self.loads)
        return self.after(evaluation, Motion(nothing, nothing), 0.0)

    def step(self, before: Motion, inverse: float) -> Joint:
        """Joint whose balance is an implicit Euler step of length 1/`inverse`, s, from a motion `before`."""
        loads, rates = self._loads(before, inverse), self.rates + inverse
        static_stiffness, moving, force = condensed_at(self.linear, rates, self.relative, loads)
        structure = replace(
            self.joint.structure,
            static_stiffness=static_stiffness,
            moving=moving,
            force_h=from_complex(np.real(force[0]), force[1:].T),
        )
        return replace(self.joint, structure=held(structure, self.joint.hold))

    def after(self, evaluation: Evaluation, before: Motion, inverse: float) -> Motion:
        """Motion at the end of a step, from the solution of the balance of the step."""
        amplitudes = with_static(self.joint.motion(evaluation)).T
        rates = self.rates + inverse
        each = zip(self.linear, rates, self._loads(before, inverse), amplitudes, strict=True)
        displacement = np.array([whole_motion(of, rate, self.relative, load, moved) for of, rate, load, moved in each])
        return Motion(displacement, rates[:, None] * displacement - inverse * before.displacement)

    def _loads(self, before: Motion, inverse: float) -> ComplexArray:
        """Right-hand side of the step (1 + H, n), N."""
        rates, inertia = self.rates + inverse, np.zeros_like(self.loads)
        if inverse:
            for place, (of, rate) in enumerate(zip(self.linear, rates.tolist(), strict=True)):
                moved, motion = before.displacement[place], motion_of(of, rate, self.relative)
                inertia[place] = motion.times("mass", rate * moved + before.velocity[place])
                inertia[place] += motion.times("damping", moved)
        return self.loads + inverse * inertia


def relax_to_periodic(joint: Joint, worn: FloatArray, start: State, start_joint: Joint, run: Run) -> State | Failure:
    """Stable periodic state of `joint` to which the structure relaxes in time from a state of `start_joint`.

    start_joint: differs from the joint in frequency and load alone.
    worn (2, n_contact): constant depths, m, and dissipated energies, J/m2. A start without excitation leads to the
    state that builds up from rest.
    Returns the state, or ADRIFT (the mean positions run away: only friction holds the parts), UNSTABLE (the motion does
    not leave an unstable periodic state) or UNSETTLED (it does not settle within `SEARCH_ITERATIONS`).
    """
    budget = run.budget
    at = f"at {joint.omega / (2.0 * np.pi):.6g} Hz"
    budget.report(f"{at}, where the vibration is left to settle in time")
    transient = Transient(joint)
    begun, history = Transient(start_joint).periodic(start.evaluation).displacement, start.next_history
    # amplitudes of a periodic motion that are constant at the frequency of this joint
    motion = Motion(begun, transient.rates[:, None] * begun)
    predicted, period = start.evaluation.predicted_h, 2.0 * np.pi / joint.omega
    # the longest step, in periods, is practically infinite: the step is the harmonic balance itself
    length, longest, tried = 1.0, 1.0 / ROUND_OFF, np.inf
    size = float(np.abs(start.evaluation.displacement_h).max())
    left = SEARCH_ITERATIONS
    # whether an unstable state has been found, which the motion leaves
    grows = False
    while left > 0 and length >= SHORTEST_STEP and not budget.exhausted:
        inverse = 1.0 / (length * period)
        balance = Balance(transient.step(motion, inverse), history, worn[0], energy=worn[1])
        before = budget.iterations
        end = run.state(balance, predicted, most=NEAR_ITERATIONS)
        left -= max(budget.iterations - before, 1)
        ahead = motion if end is None else transient.after(end.evaluation, motion, inverse)
        change = _change(motion, ahead)
        too_far = change > 2.0 * SMOOTH_CHANGE and length > 1.0
        # a step over more than the time in which a motion grows would damp this motion
        damped = grows and end is not None and not run.is_stable(balance.joint, end.evaluation)
        if damped and budget.iterations == before:
            return Failure(Outcome.UNSTABLE, f"{at} the vibration stays in an unstable state")
        if end is None or too_far or damped:
            length *= TRANSIENT_CUT
            continue
        motion, predicted, history = ahead, end.evaluation.predicted_h, end.next_history
        moved = np.abs(end.evaluation.displacement_h)
        size = max(size, float(moved[:, :, 1:].max()))
        if moved[:, :, 0].max() > RUNAWAY * size:
            return Failure(Outcome.ADRIFT, f"{at} contact pair {int(moved[:, :, 0].max(axis=1).argmax())} runs away")
        # a next attempt only where the motion changes less: Newton's method fails from a motion that still changes
        renewed = change < 0.5 * tried or length >= longest
        if change < SMALL_CHANGE and renewed:
            tried = change
            before = budget.iterations
            # with ten iterations two of 64 samples of the dovetail (16 pairs, 212.45 Hz) end as `march_failed`
            found = run.state(Balance(joint, history, worn[0], energy=worn[1]), predicted)
            left -= budget.iterations - before
            if found is not None and not run.is_stable(joint, found.evaluation):
                grows = True
            elif found and _change(transient.periodic(found.evaluation), motion) < SMOOTH_CHANGE:
                return found
        elif change > SMALL_CHANGE:
            tried = np.inf
        # amplitudes have no meaning over less than a period: steps are shorter only where Newton's method fails
        growth = float(np.clip(SMOOTH_CHANGE / max(change, 1e-300), 0.5, 2.0))
        length = min(max(length * growth, 1.0), longest)
    return Failure(Outcome.UNSETTLED, f"{at} it does not repeat after {SEARCH_ITERATIONS - left} iterations in time")


def _change(before: Motion, after: Motion) -> float:
    """Norm of the change of the vibrating amplitudes over the larger norm of two motions."""
    one, other = before.displacement[1:], after.displacement[1:]
    size = max(float(np.linalg.norm(one)), float(np.linalg.norm(other)))
    return float(np.linalg.norm(other - one)) / size if size > 0.0 else 0.0
