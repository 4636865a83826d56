"""The resonance of a vibration: the frequency at which force and motion would be a quarter of a period apart.

With x and F, the first harmonics of all displacements and of the excitation, `x^H` times the equation of motion (1) is

    w^2 x^H M x = Re x^H (K x + lambda) - Re x^H F.

At the resonance w_r the motion x with its contact forces lambda needs no part of F in phase with x:

    w_r^2 = w^2 + Re (x^H F) / (x^H M x).

For a linear oscillator w_r is the natural frequency, whatever w is. For a joint that slips and opens w_r is a Rayleigh
quotient with the contact forces of the state, hence the resonance of the present vibration. The cost is one product
with the matrices.
"""

from __future__ import annotations

from typing import cast

import numpy as np

from solver.harmonic_balance.dlft import Evaluation
from solver.model import ComplexArray, IntArray
from solver.structure.condensation import relative_indices
from solver.structure.fourier import to_complex
from solver.structure.joint import Joint


def resonance_frequency(joint: Joint, evaluation: Evaluation) -> tuple[float, float]:
    """w_r, rad/s, of a converged state, and its relative change per relative change of the motion at most.

    The latter is `|x^H F| / (2 w_r^2 x^H M x)`. Both are NaN where no mass moves, or where w_r^2 is not positive.
    """
    linear, conjugate = joint.model.harmonic_structure(1)
    mass, damping, stiffness, shape = (
        np.conj(part) if conjugate else part
        for part in (linear.mass, linear.damping, linear.stiffness, linear.load_harmonic)
    )
    relative, _ = relative_indices(joint.contact)
    internal = np.setdiff1d(np.arange(len(shape)), relative)
    force = joint.excitation_amplitude * shape
    moved = np.zeros(len(shape), complex)
    moved[relative] = to_complex(joint.to_relative(evaluation.displacement_h))[:, 0]
    if internal.size:

        def block(columns: IntArray) -> ComplexArray:
            at = np.ix_(internal, columns)
            whole = stiffness[at] + 1j * joint.omega * damping[at] - joint.omega**2 * mass[at]
            return cast("ComplexArray", whole)

        moved[internal] = np.linalg.solve(block(internal), force[internal] - block(relative) @ moved[relative])
    inertia, work = float(np.real(np.vdot(moved, mass @ moved))), complex(np.vdot(moved, force))
    if not inertia > 0.0:
        return float("nan"), float("nan")
    square = joint.omega**2 + work.real / inertia
    return (float(np.sqrt(square)), 0.5 * abs(work) / (square * inertia)) if square > 0.0 else (float("nan"),) * 2
