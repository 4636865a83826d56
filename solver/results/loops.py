"""Fretting loops: force over relative displacement of a contact pair through one period, at phases of their own.

The force is that of the law in time (`Marched`), not a series: it has corners and, where a mass turns on its
slider, jumps, and a series would overshoot there. Between the samples of the state it is interpolated linearly, so that
it stays within the friction cone; where a phase is one of the samples it is that sample. The displacement is the series
of the state, which is exact at any phase. Pairs whose mass is marched (`rigid_slider`) move by all harmonics, of which
the series has the lowest: the march gives the place at the ends of its steps, and the series how it goes on between
them.
"""

from __future__ import annotations

import numpy as np

from solver.harmonic_balance.dlft import Evaluation
from solver.model import FloatArray
from solver.structure.fourier import synthesis
from solver.structure.joint import Joint

LOOP_PHASES = 128
"""Phases of a loop, equally spaced over a period, the first 0; the same whatever the samples of a state are."""


def loop_phases() -> FloatArray:
    """Phases (LOOP_PHASES,), rad, from 0 without 2 pi."""
    return 2.0 * np.pi * np.arange(LOOP_PHASES) / LOOP_PHASES


def contact_loops(joint: Joint, evaluation: Evaluation, pairs: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
    """Relative displacement, m, and contact force, N, of some pairs of a state, both (n_pairs, LOOP_PHASES, 3).

    Components: normal, first and second tangent; positive where the pair closes and in compression. A displacement that
    a pair does not have is 0, and so is the force along it but for the constant normal load.
    """
    chosen = list(pairs)
    orders, n_samples = joint.basis.orders, joint.basis.n_samples
    series = evaluation.displacement_h[chosen]
    displacement = series @ synthesis(orders, loop_phases())
    for place, pair in enumerate(chosen):
        if joint.penalty.inertial[pair]:
            # sample n lies in the middle of step n
            ends = 2.0 * np.pi * (np.arange(n_samples) - 0.5) / n_samples
            beyond = evaluation.state_t[pair, :, :-1] - series[place, 1:] @ synthesis(orders, ends)
            # the march counts from where it starts: the mean place is that of the series
            beyond -= beyond.mean(axis=1, keepdims=True)
            displacement[place, 1:] += at_phases(beyond, 0.5)
    displacement *= (joint.contact.dofs[chosen] >= 0)[:, :, None]
    force = at_phases(evaluation.force_t[chosen], 0.0)
    return displacement.transpose(0, 2, 1), force.transpose(0, 2, 1)


def at_phases(values_t: FloatArray, lead: float) -> FloatArray:
    """Values (..., LOOP_PHASES) at the phases of a loop, by linear interpolation of periodic samples (..., N).

    lead: 0 where the first sample is at phase 0, 0.5 where it is half a step before. Whole numbers say where a phase
    lies among the samples, so that one that is a sample is that sample to the last bit.
    """
    n_samples = values_t.shape[-1]
    whole, rest = np.divmod(2 * n_samples * np.arange(LOOP_PHASES) + round(2 * lead) * LOOP_PHASES, 2 * LOOP_PHASES)
    before, after = values_t[..., whole % n_samples], values_t[..., (whole + 1) % n_samples]
    return np.asarray(before + rest / (2 * LOOP_PHASES) * (after - before))
