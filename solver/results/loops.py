"""Fretting loops: contact force over relative displacement of a pair through one period, at phases of their own.

Force: the values of the contact law in time (`solver.contact`), linearly interpolated between the samples of the state.
A Fourier series would overshoot at corners and at jumps, where a mass turns on its slider. The interpolated force is
within the friction cone and equals the sample where a phase is that of a sample.

Displacement: the series of the state, which is exact at any phase. A pair with a sliding mass (`rigid_slider`) moves
with all harmonics, of which the series holds the lowest. For such a pair the integration through the period gives the
displacement at the ends of its time steps, and the series gives the course between them.
"""

from __future__ import annotations

import numpy as np

from solver.harmonic_balance.dlft import Evaluation
from solver.model import FloatArray
from solver.structure.joint import Joint

LOOP_PHASES = 128
"""Number of phases of a loop, equally spaced over a period from 0 on, whatever the number of samples of a state is."""


def loop_phases() -> FloatArray:
    """Phases (LOOP_PHASES,), rad, from 0 without 2 pi."""
    return 2.0 * np.pi * np.arange(LOOP_PHASES) / LOOP_PHASES


def contact_loops(joint: Joint, evaluation: Evaluation, pairs: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
    """Relative displacement, m, and contact force, N, of chosen pairs of a state, both (n_pairs, LOOP_PHASES, 3).

    Components: normal, first and second tangent; closing and compression are positive. Along a direction in which a
    pair has no displacement, displacement and force are 0, but for a constant normal load.
    """
    chosen = list(pairs)
    displacement = evaluation.displacement_h[chosen] @ joint.basis.at(loop_phases())
    displacement[:, 1:] += at_phases(joint.law.beyond_series(evaluation, evaluation.displacement_h)[chosen], 0.5)
    displacement *= (joint.contact.dofs[chosen] >= 0)[:, :, None]
    force = at_phases(evaluation.force_t[chosen], 0.0)
    return displacement.transpose(0, 2, 1), force.transpose(0, 2, 1)


def at_phases(values_t: FloatArray, lead: float) -> FloatArray:
    """Values (..., LOOP_PHASES) at the phases of a loop, by linear interpolation of periodic samples (..., N).

    lead: 0 where the first sample is at phase 0, 0.5 where the first sample is half a step before.
    The positions of the phases are whole numbers: a phase of a sample gives this sample to the last bit.
    """
    n_samples = values_t.shape[-1]
    whole, rest = np.divmod(2 * n_samples * np.arange(LOOP_PHASES) + round(2 * lead) * LOOP_PHASES, 2 * LOOP_PHASES)
    before, after = values_t[..., whole % n_samples], values_t[..., (whole + 1) % n_samples]
    return np.asarray(before + rest / (2 * LOOP_PHASES) * (after - before))
