"""Tuning constants of the loading history: start, steps and restarts of a sweep."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from solver.continuation.options import CONTINUATION


@dataclass(frozen=True)
class LoadingOptions:
    """Lengths and limits: for each its meaning, its unit (none: a ratio) and the evidence for its value.

    The parameter is the frequency of a sweep, or the load factor of a ramp.
    """

    # where a sweep begins
    begin_away: float = 0.3
    """Least distance from the start of a sweep to the point, as a fraction of the frequency of the point. With 0.22 and
    0.38 the dovetail has the same state within 2e-3."""
    cells_per_octave: int = 4
    """Cells in an octave. All points of a cell have one first frequency: 105 Hz, half the resonance, for the
    dovetail."""
    origin_candidates: int = 8
    """Candidates for the first frequency of a cell, of which the one with the least load on the stuck joint is chosen.
    They are 2 % apart and at least 1 % away from two resonances of the dovetail, 212.9 and 411 Hz."""

    # one step
    free_step: float = 1e-3
    """Fraction of the parameter: length of the steps with continuation through folds, or settling in time, where a
    branch ends. The load factor at which a ramp begins; the amplitude at which a nonlinear mode begins, as vibrating
    contact forces over the friction limits (with ten times the value and with a tenth the nodes lie elsewhere: the
    damping of the dovetail changes by 7e-5 and 1e-3); its smallest growth from node to node."""

    # steps of a sweep: dovetail of 48 pairs, compared with steps twenty times as short. Errors of the motion at 211,
    # 211.5, 212 and 212.5 Hz: 0.25, 0.05, 0.18 and 0.8 % with a largest change of 0.2 (48 nodes in all), 0.06, 0.04,
    # 0.03 and 0.1 % with 0.05 (155 nodes)
    change_per_rtol: float = 20.0
    """Largest relative change of the vibration in a step, over rtol: see above."""
    change_limits: tuple[float, float] = (0.05, 0.2)
    """Limits of the largest change, see above. Blade root of the deck `blade_root`, rtol 5e-2: the wear rates with 0.2
    and 0.03 differ by 0.04 %, for 620 and 1680 iterations."""
    small_vibration: float = 0.3
    """Fraction of the friction limits: changes of a smaller vibration are relative to this fraction. With 1 the error
    of the motion at 211 Hz is three times as large, with 0 there are a few nodes more."""
    least_slip: float = 1e-3
    """Slip of a pair over its motion above which it forgets its history."""
    aimed_change: float = 0.75
    """Expected change of the vibration in the next step, as a fraction of the largest change. Few steps are refused."""
    longest_sweep_step: float = 0.1
    """Longest step, as a fraction of the parameter."""
    shortest_sweep_step: float = 2e-5
    """Shortest step, as a fraction of the parameter, whatever the change of the vibration is. An undamped slider passes
    its resonance in such steps."""
    sweep_iterations: int = 8000
    """Most Newton iterations of a sweep: more in jumps and searches are in vain (the dovetail takes 300). Parts of the
    sweep may take the shares `node_iterations` and `first_iterations`."""

    iterations_per_save: int = 100
    """Newton iterations after which a sweep is saved at its next node, and its factorisation dropped, so that a resumed
    sweep is equal to the last bit: 1 s of 48 pairs, 17 s of 336."""

    # where the first attempt fails
    other_starts: tuple[tuple[int, int], ...] = ((1, 64), (3, 256), (15, 256))
    """Harmonics and samples of further attempts to find a first state."""

    def largest_change(self, rtol: float, wider: float, *, sticks: bool) -> float:
        """Largest relative change of the vibration in a step; wider: factor where pairs slip or open.

        sticks: whether no pair slips or opens at both ends. A longer step might go over a whole resonance.
        """
        if sticks:
            return CONTINUATION.linear_change
        return wider * float(np.clip(self.change_per_rtol * rtol, *self.change_limits))

    @property
    def node_iterations(self) -> int:
        """Most Newton iterations from one node to the next, and from a node to a point: three transients of 800."""
        return 5 * self.sweep_iterations // 16

    @property
    def first_iterations(self) -> int:
        """Most Newton iterations of all attempts to begin a sweep, or to begin it again.

        Tens to hundreds suffice where some pairs stick; a joint that slips everywhere takes all of them in vain.
        """
        return self.sweep_iterations // 8


LOADING = LoadingOptions()
