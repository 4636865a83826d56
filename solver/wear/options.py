"""Tuning constants of the integration over the slow time: steps and their limits, loss of a branch, output."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class WearOptions:
    """Lengths and limits: for each its meaning, its unit (none: a ratio) and the evidence for its value."""

    # adaptive steps
    step_error_fraction: float = 0.5
    """Allowed error of a step over its wear, or over its wear at the mean rate so far if larger, as a fraction of
    rtol."""
    largest_step_ratio: float = 2.0
    """Largest ratio of two successive steps; BDF2 is zero-stable below 1 + sqrt(2)."""
    smallest_step_ratio: float = 0.25
    """Factor on a step whose end was not found, and smallest factor on a step that was refused."""
    step_safety: float = 0.85
    """Length of a step over the length with the allowed error."""
    refused_step_ratio: float = 0.8
    """Largest factor on a step that was refused, and smallest factor from an accepted step to the next."""
    first_step: float = 0.05
    """Length of the first step, whose error is not known, as a fraction of the explicit step limit."""
    first_depth: float = 0.01
    """Largest wear of the first step, as a fraction of the largest relative motion."""
    shortest_slow_step: float = 1e-4
    """Shortest step, as a fraction of the first step."""
    step_iterations: int = 10
    """Most Newton iterations of a step before it is shortened. Each step adds as many to the budget of a history."""

    # Euler steps
    largest_moved_load: float = 10.0
    """Largest change of the normal forces in a step, over these forces, both as norms. For smaller changes the error of
    the worn volume is a sufficient warning (27 % with 0.6)."""

    # history
    history_iterations: int = 3000
    """Most Newton iterations of a history, in addition to `step_iterations` for each step, and of its reference
    solution, in addition to those of the history. A travelling wave at its resonance: 1400 in a corner within 500
    cycles."""
    iterations_per_save: int = 100
    """Newton iterations after which a history is saved and its factorisation dropped, so that a resumed history is
    equal to the last bit: 1 s of 48 pairs, 17 s of 336. The cost of one more factorisation is negligible."""
    left_out_grown: float = 1.5
    """Growth of the part of the contact force in harmonics that are left out, since the last choice of harmonics, above
    which a new choice is possible. Dovetail, 211.5, 211.75, 212.5 Hz: 0.8 to 1.4 over 1e5 cycles."""
    left_out_fallen: float = 0.2
    """Ratio of this part to the one at the last choice of harmonics, below which fewer harmonics are tried."""
    alternations: int = 4
    """Number of increments of a wear rate with alternating sign and without decay that make an oscillation."""
    noticeable_oscillation: float = 1e-3
    """Fraction of the largest wear rate of the joint: smaller increments are no oscillation."""
    calming: float = 0.98
    """Ratio of two successive increments below which an oscillation decays."""

    # steady state
    steady_rate: float = 0.01
    """Relative change of the wear rate of a joint that slips everywhere, over the last nine tenths of its worn volume.
    Below, the wear rate is steady and the wear does not end."""
    acted_back: float = 100.0
    """Change of the normal force by the depth of one pair alone, all other pairs held, over the normal force of this
    pair. A wear rate counts as steady above only: less wear may not have acted back on the joint yet. Long waves of n
    pairs are about n times as soft."""
    steps_to_the_end: int = 20_000
    """Most steps of a history without a steady state; a joint takes 2 to 10 steps a pair."""
    longest_march: float = 1e25
    """Most cycles of a history without a steady state."""

    # final state without slow time
    off_margin: float = 10.0
    """Distance by which a pair is opened, over the overlap of all pairs (each as if it alone gave way). The pair
    remains open while others are opened; the result does not depend on the distance."""
    off_tolerance: float = 1e-3
    """Tolerance of the state that gives the depths, as a fraction of the tolerance of a state: one more iteration
    (a sphere without it: error of 3e-6 of the depth)."""
    off_attempts: int = 4
    """Most attempts, each with ten times the margin of the last one."""
    loss_of_rate: float = 0.5
    """Largest reduction of the wear rate of a pair by the wear of the others, over the change by its own wear. Above,
    the pair may stick again. Cylinder in partial slip: the others add 0.4 to 0.9. Sphere: they reduce the rate by 0.2
    at the edge of the stick zone in the unworn state, and add later."""
    same_depth: float = 1e-3
    """Largest difference of the final depths after different histories of friction, as a fraction of the largest
    depth."""
    tested_states: int = 3
    """Number of states from the unworn to the final one, the first included, at which the loss of rate is tested."""

    # loss of a branch
    fold_resolution: float = 0.01
    """Accuracy of the end of a branch, as a fraction of the cycle count."""
    smallest_fold_resolution: float = 2.0**-10
    """Finest accuracy of the end of a branch, as a fraction of a step."""
    jump_change: float = 0.05
    """Relative change of the vibration at the end of a branch above which the change is a jump. Corners at which the
    branch folds back a little are no jumps, and there may be many of them."""
    jump_iterations: int = 800
    """Most Newton iterations of the search for the state after a jump."""

    # joints that slide as a whole
    free_closing: float = 1e-6
    """Largest closing component of a free direction of norm 1, for sliding closes no pair."""

    round_off: float = 1e-9
    """Round-off as a fraction. Of the largest normal force: a pair with less does not bear the joint. Of
    `WearState.most_rate`, the rate if all pairs slipped as far as they move: less is no oscillation. Of the largest
    eigenvalue of the static stiffness: a direction with less is free (dovetail: 1e-15 for the free direction, -1.6e-6
    for the next one, by spin softening)."""

    # output
    kept_steps: int = 800
    """Most stored steps of a history to the steady state; half as many after the steps with the least progress are
    dropped. A result has 101 outputs by default."""
    course_steps: int = 256
    """Most ends of steps at which a history is compared with its reference solution; an adaptive history of 1e5 cycles
    has about 100."""


WEAR = WearOptions()
