"""The joint at one frequency and load: condensed structure, contact pairs, friction and penalty."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.harmonics import FourierBasis, build_basis
from solver.model import ContactInterface, FloatArray, IntArray, ReducedModel
from solver.settings import SolverSettings
from solver.structure import CondensedStructure, build_penalty, build_structure, relative_indices

PENALTY_RATE = 10.0  # over the first harmonic left out


@dataclass(frozen=True)
class Joint:
    """Everything that stays the same while a periodic state is sought.

    slots (n_rel,): place `3 pair + component` of each relative displacement. penalty (n_contact, 2): normal and
    tangential, N/m. has_normal (n_contact,) bool: False where the normal force is constant.
    """

    omega: float
    excitation_amplitude: float
    friction_coefficient: float
    structure: CondensedStructure
    contact: ContactInterface
    basis: FourierBasis
    slots: IntArray
    penalty: FloatArray
    has_normal: FloatArray

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
    penalty: FloatArray
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


def build_case(
    model: ReducedModel, friction_coefficient: float, omega: float, settings: SolverSettings
) -> Case:
    """Case of a scene; omega, rad/s, is where the penalty is taken and has to be the same for states that are compared."""
    rate = PENALTY_RATE * (settings.harmonics + 1) * omega
    return Case(model, friction_coefficient, build_penalty(model, rate), settings)


def static_joint(joint: Joint, load_factor: float) -> Joint:
    """The same joint under a part of its static load alone: no harmonics, one sample."""
    structure = joint.structure
    held = CondensedStructure(
        static_stiffness=structure.static_stiffness,
        dynamic_stiffness=structure.dynamic_stiffness[:0],
        static_force=load_factor * structure.static_force,
        harmonic_force=structure.harmonic_force,
        static_response=structure.static_response,
        dynamic_response=structure.dynamic_response[:0],
        static_offset=load_factor * structure.static_offset,
        harmonic_offset=structure.harmonic_offset,
    )
    return Joint(
        omega=joint.omega,
        excitation_amplitude=0.0,
        friction_coefficient=joint.friction_coefficient,
        structure=held,
        contact=joint.contact,
        basis=build_basis(0, 1),
        slots=joint.slots,
        penalty=joint.penalty,
        has_normal=joint.has_normal,
    )
