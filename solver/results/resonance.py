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

import numpy as np

from solver.harmonic_balance.dlft import Evaluation
from solver.structure.condensation import relative_indices, whole_motion
from solver.structure.fourier import to_complex
from solver.structure.joint import Joint


def resonance_frequency(joint: Joint, evaluation: Evaluation) -> tuple[float, float]:
    """w_r, rad/s, of a converged state, and its relative change per relative change of the motion at most.

    The latter is `|x^H F| / (2 w_r^2 x^H M x)`. Both are NaN where no mass moves, or where w_r^2 is not positive.
    """
    linear = joint.model.harmonic_structure(1)
    relative, _ = relative_indices(joint.contact)
    force = joint.excitation_amplitude * linear.load_harmonic
    first = to_complex(joint.to_relative(evaluation.displacement_h))[:, 0]
    moved = whole_motion(linear, 1j * joint.omega, relative, force, first)
    inertia, work = float(np.real(np.vdot(moved, linear.mass @ moved))), complex(np.vdot(moved, force))
    if not inertia > 0.0:
        return float("nan"), float("nan")
    square = joint.omega**2 + work.real / inertia
    return (float(np.sqrt(square)), 0.5 * abs(work) / (square * inertia)) if square > 0.0 else (float("nan"),) * 2
