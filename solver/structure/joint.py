"""The joint at one frequency and load: condensed structure, contact pairs and penalty."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from solver.contact.element import Element
from solver.contact.law import build_law
from solver.model import ContactInterface, FloatArray, IntArray, ReducedModel
from solver.packing import packable
from solver.settings import Resolution, SolverSettings, first_resolution
from solver.structure.condensation import CondensedStructure, build_structure
from solver.structure.fourier import FourierBasis, build_basis
from solver.structure.harmonic_stiffness import DenseStiffness
from solver.structure.penalty import Penalty, build_penalty


@dataclass(frozen=True)
class Joint:
    """A joint at one frequency omega, rad/s, and excitation amplitude, N.

    structure: with the spring of the hold, if there is one (`held`). contact: the pairs as they are now, those of the
    model where nothing has changed them.
    """

    model: ReducedModel
    contact: ContactInterface
    omega: float
    excitation_amplitude: float
    structure: CondensedStructure
    basis: FourierBasis
    penalty: Penalty
    hold: Hold | None = None

    def after(self, energy: FloatArray) -> Joint:
        """The joint after some dissipated energy (n_contact,), J/m2; the same object where it changes nothing."""
        return self.with_contact(self.model.contact.after(energy))

    def with_contact(self, contact: ContactInterface) -> Joint:
        """The joint with a contact; the same object where it has this one."""
        return self if contact is self.contact else replace(self, contact=contact)

    def motion(self, at: Any) -> FloatArray:
        """Relative displacements (n_rel, m) of the structure, m, in an evaluated state of the joint."""
        flexibility, _ = self.model.contact.after(at.energy).flexibility
        return self.to_relative(at.displacement_h + flexibility[:, :, None] * at.force_h)

    @property
    def component_index(self) -> IntArray:
        """As in `ContactInterface`."""
        return self.contact.component_index

    @cached_property
    def law(self) -> Element:
        """The contact law of the pairs."""
        return build_law(self.penalty, self.contact, self.basis, self.omega)

    @property
    def resolution(self) -> Resolution:
        """Harmonics and samples."""
        return Resolution(self.basis.orders, self.basis.n_samples)

    @property
    def relative_penalty(self) -> FloatArray:
        """Penalty (n_rel,), N/m, of each relative displacement."""
        return self.penalty.stiffness.ravel()[self.component_index]

    def rows_of(self, pairs: IntArray) -> IntArray:
        """Indices of the relative displacements of ascending pairs, ascending."""
        rows = self.contact.pair_rows[pairs].ravel()
        return rows[rows >= 0]

    def to_pairs(self, values: FloatArray) -> FloatArray:
        """Values (n_contact, 3, m) of the pairs from (n_rel, m); zero where a pair has no such displacement."""
        spread = np.zeros((3 * self.contact.n_contact, values.shape[1]))
        spread[self.component_index] = values
        return spread.reshape(self.contact.n_contact, 3, values.shape[1])

    def to_relative(self, values: FloatArray) -> FloatArray:
        """Values (n_rel, m) of the relative displacements from (n_contact, 3, m)."""
        return values.reshape(3 * self.contact.n_contact, values.shape[2])[self.component_index]


@packable
@dataclass(frozen=True, eq=False)
class Hold:
    """A soft spring, N/m, on the mean position of a joint along a direction in which the joint can slide freely.

    direction (n_rel,): of norm 1. position: along the direction, at which the spring has no force, m.
    """

    direction: FloatArray
    stiffness: float
    position: float


def held(structure: CondensedStructure, hold: Hold | None) -> CondensedStructure:
    """A condensed structure with the spring of a hold, if there is one, on its mean position."""
    if hold is None:
        return structure
    force_h = structure.force_h.copy()
    force_h[:, 0] += hold.stiffness * hold.position * hold.direction
    spring = hold.stiffness * np.outer(hold.direction, hold.direction)
    return replace(structure, static_stiffness=structure.static_stiffness + spring, force_h=force_h)


@dataclass(frozen=True, eq=False)
class Case:
    """What all states of one computation share; equal to itself alone.

    penalty_omega: angular frequency for which the penalty is built, rad/s.
    hold: spring on a joint that slides as a whole, see `solver.wear.jump`; None without a spring.
    """

    model: ReducedModel
    penalty_omega: float
    penalty: Penalty
    settings: SolverSettings
    resolution: Resolution
    hold: Hold | None = None

    def joint(self, omega: float, excitation_amplitude: float) -> Joint:
        """Joint at the angular frequency omega (rad/s) and excitation amplitude (N).

        Raises SingularStructureError where the structure with a stuck joint is singular at a harmonic.
        """
        orders = self.resolution.orders
        structure = held(build_structure(self.model, omega, excitation_amplitude, orders), self.hold)
        basis = build_basis(orders, self.resolution.samples)
        contact = self.model.contact
        return Joint(self.model, contact, omega, excitation_amplitude, structure, basis, self.penalty, self.hold)

    def at(self, resolution: Resolution) -> Case:
        """The case with another resolution, and the penalty for its harmonics."""
        if resolution == self.resolution:
            return self
        penalty = build_penalty(self.model, self.penalty_omega, resolution.highest)
        return replace(self, penalty=penalty, resolution=resolution)


def build_case(
    model: ReducedModel, omega: float, settings: SolverSettings, resolution: Resolution | None = None
) -> Case:
    """Case of a model with friction.

    omega: angular frequency for which the penalty is built, rad/s; equal for states that are compared.
    resolution: by default from the settings.
    """
    chosen = resolution or first_resolution(settings)
    penalty = build_penalty(model, omega, chosen.highest)
    return Case(model, omega, penalty, settings, chosen)


def static_joint(joint: Joint, load_factor: float) -> Joint:
    """The joint under a fraction of its static load, without excitation: no harmonics, one sample."""
    structure = joint.structure
    still = replace(
        structure,
        moving=DenseStiffness(np.empty((0, *structure.static_stiffness.shape), complex)),
        dynamic_response=structure.dynamic_response[:0],
        force_h=load_factor * structure.force_h[:, :1],
        static_offset=load_factor * structure.static_offset,
    )
    # without velocities each pair is taken at displacement level
    penalty = replace(joint.penalty, inertial=np.zeros_like(joint.penalty.inertial))
    return replace(joint, excitation_amplitude=0.0, structure=still, basis=build_basis((), 1), penalty=penalty)


def viscous_joint(joint: Joint, viscosity: float, before: FloatArray) -> Joint:
    """The joint of a static state, with a force `-c (u - u_before)` on each relative displacement u.

    viscosity: c over the penalty of the pair. before (n_contact, 3, 1): displacements u_before, m.
    """
    coefficient, structure, penalty = viscosity * joint.relative_penalty, joint.structure, joint.penalty
    viscous = replace(
        structure,
        static_stiffness=structure.static_stiffness + np.diag(coefficient),
        force_h=structure.force_h + coefficient[:, None] * joint.to_relative(before),
    )
    # the penalty remains that of a pair which moves alone
    growth = 1.0 + viscosity
    penalty = replace(penalty, normal=growth * penalty.normal, tangential=growth * penalty.tangential)
    return replace(joint, structure=viscous, penalty=penalty)
