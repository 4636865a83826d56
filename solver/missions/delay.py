"""How fast a passage is: the vibration follows the frequency with a delay.

What the vibration differs from that of the steady state dies out as exp(-zeta omega t). So a passage shows at one
frequency what belongs to another frequency, which it has passed before:

    lag = |df/dt| / (2 pi zeta f).

Where the wear rate rises or falls, the passage then wears less or more than its steady states, at most the lag times
the largest wear over frequency. The damping ratio zeta is that of the structure with its closed pairs sticking, as the
vibration grows with the joint still at rest. Friction damps more where pairs slip. The number |df/dt| / (zeta f)^2 says
how fast a passage is.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from solver.missions.blocks import Block, Passage
from solver.model import ComplexArray, FloatArray
from solver.modes.modal_model import linear_mode
from solver.results.history import PeriodicState
from solver.structure.joint import friction_of_pairs


@dataclass(frozen=True)
class Delay:
    """The delay of a passage.

    sweep_rate: |df/dt| / (zeta f)^2.
    lag: Hz.
    """

    sweep_rate: float
    lag: float


def delay_of(
    block: Block, passage: Passage, frequencies: FloatArray, responses: ComplexArray, states: Sequence[PeriodicState]
) -> Delay:
    """The delay of a passage.

    Parameters
    ----------
    block, passage
        The block with its model, and its passage.
    frequencies
        (n_state,), ascending, Hz.
    responses
        (n_state, n_response), complex first harmonics, m.
    states
        The states at the frequencies.

    Returns
    -------
    Delay
        With the mode nearest to the largest response, of the joint whose closed pairs stick, or slide or are open where
        the joint cannot move otherwise. No delay without mass. A structure without damping has the half-power
        half-width of its response in place of `zeta f`, and an infinite delay where no peak is passed.
    """
    size = np.abs(responses).max(axis=1)
    state = states[int(np.argmax(size))]
    friction = friction_of_pairs(block.model, block.friction_coefficient)
    closed = state.contact_force_h[:, 0, 0] > 0.0
    joints = ((closed, friction), (closed, 0.0 * friction), (np.zeros_like(closed), friction))
    modes = (linear_mode(block.model, *joint, near=state.omega) for joint in joints)
    mode = next((found for found in modes if found is not None), None)
    if mode is None:
        return Delay(0.0, 0.0)
    width = mode.damping_ratio * mode.omega / (2.0 * math.pi)
    width = width if width > 0.0 else half_width(frequencies, size)
    if width == 0.0:
        return Delay(math.inf, math.inf)
    return Delay(passage.rate / width**2, passage.rate / (2.0 * math.pi * width))


def half_width(frequencies: FloatArray, size: FloatArray) -> float:
    """Half-power half-width, Hz, of responses (n,), m, at ascending frequencies (n,), Hz; 0 where no peak is passed.

    One side of a bent peak is a jump: the width is that of the wider side.
    """
    top = int(np.argmax(size))
    if top in (0, len(size) - 1):
        return 0.0
    sides = [0.0]
    for way in (-1, 1):
        places = np.arange(top, len(size)) if way > 0 else np.arange(top, -1, -1)
        below = np.flatnonzero(size[places] < size[top] / np.sqrt(2.0))
        if below.size:
            one, other = places[below[0] - 1], places[below[0]]
            share = (size[one] - size[top] / np.sqrt(2.0)) / (size[one] - size[other])
            at = frequencies[one] + share * (frequencies[other] - frequencies[one])
            sides.append(float(abs(at - frequencies[top])))
    return max(sides)
