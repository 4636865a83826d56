"""Tuning constants of the integration over the slow time: steps and their limits, loss of a branch, output."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class WearOptions:
    """Lengths and limits: for each its meaning, its unit (none: a ratio) and the evidence for its value."""

    # adaptive steps
    step_error_fraction: float = 0.25
    """Allowed error of a step over its wear, or over its wear at the mean rate so far if larger, as a fraction of
    rtol. Dovetail, 16 pairs, nine harmonics, 212.42 to 213 Hz, `rtol` 1e-2: errors of the worn volume up to 0.21 %.
    With 0.5 a quarter to a third less steps, up to 0.5 %, and 5.9 % at 212.5 Hz, where a pair that only just slips then
    sticks."""
    first_step: float = 0.05
    """Length of the first step, whose error is not known, as a fraction of the explicit step limit."""
    first_depth: float = 0.01
    """Largest wear of the first step, as a fraction of the largest relative motion."""
    shortest_slow_step: float = 1e-4
    """Shortest step, as a fraction of the first step."""
    doublings_across: int = 4
    """Most doublings of the shortest step to go across corners. Dovetail, mesh 2, nodal diameter 3, 213.5 Hz: four
    steps across, by 3, 2, 2 and 4 doublings; without them `march_failed` after 846 cycles. Mesh 1, 212.42 Hz, `rtol`
    0.05: none, but with some BLAS kernels three were needed before pairs slid along the steps. The local errors of
    these steps were 0.1 to 2.7 times the allowed ones."""

    # friction on the slow time scale
    parts_of_step: int = 32
    """Parts of a step in each of which the pairs slide at their friction limit. Dovetail, 16 pairs, 212.6 Hz, 1e5
    cycles, nine harmonics, `rtol` 1e-2: 1.795, 1.813, 1.819, 1.819, 1.822 mm3 with 1, 8, 32, 128, 512 parts (`rtol`
    2e-4: 1.823). 32 parts take a tenth of the time of a history."""

    # Euler steps
    largest_moved_load: float = 10.0
    """Largest change of the normal forces in a step, over these forces, both as norms. For smaller changes the error of
    the worn volume is a sufficient warning (27 % with 0.6)."""

    # history
    history_iterations: int = 3000
    """Most Newton iterations of a history, in addition to `near_iterations` for each step, and of its reference
    solution, in addition to those of the history. A travelling wave at its resonance: 1400 in a corner within 500
    cycles."""
    iterations_per_save: int = 100
    """Newton iterations after which a history is saved and its factorisation dropped, so that a resumed history is
    equal to the last bit: 1 s of 48 pairs, 17 s of 336. The cost of one more factorisation is negligible."""
    left_out_grown: float = 1.5
    """Growth of the part of the contact force in harmonics that are left out, since the last choice of harmonics, above
    which a new choice is possible. Dovetail, 211.5, 211.75, 212.5 Hz: 0.8 to 1.4 over 1e5 cycles."""

    # steady state
    acted_back: float = 100.0
    """Change of the normal force by the depth of one pair alone, all other pairs held, over the normal force of this
    pair. A wear rate counts as steady above only: less wear may not have acted back on the joint yet. Long waves of n
    pairs are about n times as soft."""
    steps_to_the_end: int = 20_000
    """Most steps of a history without a steady state; a joint takes 2 to 10 steps a pair."""
    longest_march: float = 1e25
    """Most cycles of a history without a steady state."""

    # final state without slow time
    loss_of_rate: float = 0.5
    """Largest reduction of the wear rate of a pair by the wear of the others, over the change by its own wear. Above,
    the pair may stick again. Cylinder in partial slip: the others add 0.4 to 0.9. Sphere: they reduce the rate by 0.2
    at the edge of the stick zone in the unworn state, and add later."""
    tested_states: int = 3
    """Number of states from the unworn to the final one, the first included, at which the loss of rate is tested."""

    # loss of a branch
    fold_resolution: float = 0.01
    """Accuracy of the end of a branch, as a fraction of the cycle count."""

    # output
    kept_steps: int = 800
    """Most stored steps of a history to the steady state; half as many after the steps with the least progress are
    dropped. Most ends of steps at which a history is compared with its reference solution. A result has 101 outputs by
    default, an adaptive history of 1e5 cycles about 100 steps."""


WEAR = WearOptions()
