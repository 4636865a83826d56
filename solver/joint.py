"""The joint at one frequency and load: condensed structure, contact pairs, friction and penalty."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from solver.harmonics import FourierBasis, build_basis, derivative
from solver.model import BoolArray, ContactInterface, FloatArray, IntArray, ReducedModel
from solver.penalty import Penalty, build_penalty, static_penalty
from solver.settings import SolverSettings
from solver.structure import CondensedStructure, build_structure, relative_indices


@dataclass(frozen=True)
class Joint:
    """Everything that stays the same while a periodic state is sought.

    slots (n_rel,): place `3 pair + component` of each relative displacement. has_normal (n_contact,): False where the
    normal force is constant. state_stiffness (n_contact,): N/m, what turns the tangential state of `kernels` into slip.
    """

    omega: float
    excitation_amplitude: float
    friction_coefficient: float
    structure: CondensedStructure
    contact: ContactInterface
    basis: FourierBasis
    slots: IntArray
    penalty: Penalty
    has_normal: BoolArray

    @property
    def state_stiffness(self) -> FloatArray:
        """Tangential state over slip (n_contact,), N/m: at velocity level the state is a sum over the samples."""
        samples_per_radian = self.basis.n_samples / (2.0 * np.pi)
        return self.penalty.tangential * np.where(self.penalty.at_velocity, self.omega * samples_per_radian, 1.0)

    def motion(self, surplus: FloatArray) -> FloatArray:
        """Motion (n_contact, 3, m, ...), m, from the predicted force beyond the contact force, same shape, N.

        Linear; Eq. (12) divided by the penalty, at velocity level integrated over time. The mean position of pairs at
        velocity level is relative to their history.
        """
        shape = (-1,) + (1,) * (surplus.ndim - 2)
        moved = np.empty_like(surplus)
        moved[:, 0] = surplus[:, 0] / self.penalty.normal.reshape(shape)
        moved[:, 1:] = surplus[:, 1:] / self.penalty.tangential.reshape((*shape, 1))
        fast = self.penalty.at_velocity
        if fast.any() and surplus.shape[2] > 1:
            n_harmonics = (surplus.shape[2] - 1) // 2
            order = self.omega * np.arange(1, n_harmonics + 1).reshape((-1,) + (1,) * (surplus.ndim - 3))
            rate = moved[fast, 1:]
            moved[fast, 1:, 1::2] = -rate[:, :, 2::2] / order
            moved[fast, 1:, 2::2] = rate[:, :, 1::2] / order
        moved[fast, 1:, 0] = surplus[fast, 1:, 0] / self.penalty.mean[fast].reshape((-1,) + (1,) * (surplus.ndim - 2))
        return moved

    def surplus(self, motion: FloatArray) -> FloatArray:
        """Predicted force beyond the contact force, N, from a motion (n_contact, 3, m), m: the inverse of `motion`."""
        force = np.empty_like(motion)
        force[:, 0] = motion[:, 0] * self.penalty.normal[:, None]
        force[:, 1:] = motion[:, 1:] * self.penalty.tangential[:, None, None]
        fast = self.penalty.at_velocity
        force[fast, 1:] = derivative(motion[fast, 1:], self.omega) * self.penalty.tangential[fast, None, None]
        force[fast, 1:, 0] = motion[fast, 1:, 0] * self.penalty.mean[fast, None]
        return force

    def to_pairs(self, values: FloatArray) -> FloatArray:
        """(n_contact, 3, m) from (n_rel, m): zero where a pair has no such displacement."""
        spread = np.zeros((3 * self.contact.n_contact, values.shape[1]))
        spread[self.slots] = values
        return spread.reshape(self.contact.n_contact, 3, values.shape[1])

    def to_relative(self, values: FloatArray) -> FloatArray:
        """(n_rel, m) from (n_contact, 3, m)."""
        return values.reshape(3 * self.contact.n_contact, values.shape[2])[self.slots]


@dataclass(frozen=True)
class Case:
    """What all states of one computation have in common; `joint` gives the joint at a frequency and amplitude."""

    model: ReducedModel
    friction_coefficient: float
    penalty: Penalty
    settings: SolverSettings

    def joint(self, omega: float, excitation_amplitude: float) -> Joint:
        """Joint at the angular frequency omega (rad/s) and excitation amplitude (N).

        Raises numpy.linalg.LinAlgError where the structure with its joint held is singular at a harmonic.
        """
        _, slots = relative_indices(self.model.contact)
        return Joint(
            omega=omega,
            excitation_amplitude=excitation_amplitude,
            friction_coefficient=self.friction_coefficient,
            structure=build_structure(self.model, omega, excitation_amplitude, self.settings.harmonics),
            contact=self.model.contact,
            basis=build_basis(self.settings.harmonics, self.settings.samples),
            slots=slots,
            penalty=self.penalty,
            has_normal=self.model.contact.dofs[:, 0] >= 0,
        )


def build_case(model: ReducedModel, friction_coefficient: float, omega: float, settings: SolverSettings) -> Case:
    """Case of a scene; omega, rad/s, is where the penalty is taken: the same for states that are compared."""
    return Case(model, friction_coefficient, build_penalty(model, omega, settings.harmonics), settings)


def static_joint(joint: Joint, load_factor: float) -> Joint:
    """The same joint under a part of its static load alone: no harmonics, one sample."""
    structure = joint.structure
    held = replace(
        structure,
        dynamic_stiffness=structure.dynamic_stiffness[:0],
        dynamic_response=structure.dynamic_response[:0],
        static_force=load_factor * structure.static_force,
        static_offset=load_factor * structure.static_offset,
    )
    # a static load has no velocity: every pair is held at displacement level
    penalty = static_penalty(joint.penalty)
    return replace(joint, excitation_amplitude=0.0, structure=held, basis=build_basis(0, 1), penalty=penalty)
