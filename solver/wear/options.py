"""Tuning constants of the integration over the slow time: steps and their limits, loss of a branch, output."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class WearOptions:
    """Lengths and limits: for each its meaning, its unit (none: a ratio) and the evidence for its value."""

    # adaptive steps
    step_error_fraction: float = 0.5
    """Allowed error of a step over its wear, or over its wear at the mean rate so far if larger, as a fraction of
    rtol. Dovetail of 16 pairs, 212.5 Hz: volumes of 1.874, 1.859 and 1.846 mm3 with 0.25, 0.5 and 1, for 442, 377 and
    313 iterations."""
    largest_step_ratio: float = 2.0
    """Largest ratio of two successive steps; BDF2 is zero-stable below 1 + sqrt(2). A step that is refused is shortened
    by this factor at most."""
    step_safety: float = 0.85
    """Length of a step over the length with the allowed error. The same dovetail: with 0.7 8 % fewer
    iterations, with 0.95 7 % more; volumes equal within 0.13 %, the told error least with 0.85."""
    first_step: float = 0.05
    """Length of the first step over the explicit step limit, or over the length in which the fastest pair wears as much
    as the joint moves, if smaller. The same dovetail: with 0.01 4 % fewer iterations, with 0.5 6 % more; volumes equal
    within 0.12 %."""
    step_iterations: int = 10
    """Most Newton iterations of a step before it is shortened. Each step adds as many to the budget of a history. The
    same dovetail: with 6 and with 20 1 to 3 % fewer iterations, equal volumes."""

    # Euler steps
    arnoldi_products: int = 16
    """Linear solves for the limit of the explicit step. The same dovetail: the limit is equal with 8 and 32 in six
    digits."""
    largest_moved_load: float = 10.0
    """Largest change of the normal forces in a step, over these forces, both as norms. For smaller changes the error of
    the worn volume is a sufficient warning (27 % with 0.6)."""

    # history
    history_iterations: int = 3000
    """Most Newton iterations of a history, in addition to `step_iterations` for each step, and of its reference
    solution, in addition to those of the history. A travelling wave at its resonance: 1400 in a corner within 500
    cycles."""
    iterations_per_save: int = 30
    """Newton iterations after which a history is saved and its factorisation dropped, so that a resumed history is
    equal to the last bit: 0.3 s of 48 pairs, 5 s of 336. The cost of one more factorisation is negligible."""
    alternations: int = 4
    """Number of increments of a wear rate with alternating sign and without decay that make an oscillation."""
    calming: float = 0.98
    """Ratio of two successive increments below which an oscillation decays."""

    # steady state
    acted_back: float = 100.0
    """Change of the normal force by the depth of one pair alone, all other pairs held, over the normal force of this
    pair. A wear rate counts as steady above only: less wear may not have acted back on the joint yet. Long waves of n
    pairs are about n times as soft."""
    steps_to_the_end: int = 20_000
    """Most steps of a history without a steady state; a joint takes 2 to 10 steps a pair."""
    longest_history: float = 1e25
    """Most cycles of such a history: where one pair sticks and another one with a constant normal load slips for ever,
    each adaptive step is twice as long as the last one."""

    # final state without slow time
    off_margin: float = 10.0
    """Distance by which a pair is opened, over the overlap of all pairs (each as if it alone gave way), and its growth
    from one attempt to the next. The pair remains open while others are opened; the result does not depend on the
    distance."""
    off_attempts: int = 4
    """Most attempts, each with ten times the margin of the last one."""
    loss_of_rate: float = 0.5
    """Largest reduction of the wear rate of a pair by the wear of the others, over the change by its own wear. Above,
    the pair may stick again. Cylinder in partial slip: the others add 0.4 to 0.9. Sphere: they reduce the rate by 0.2
    at the edge of the stick zone in the unworn state, and add later."""
    tested_states: int = 3
    """Number of states from the unworn to the final one, the first included, at which the loss of rate is tested."""

    # loss of a branch
    fold_resolution: float = 0.01
    """Accuracy of the end of a branch, as a fraction of the cycle count."""
    jump_iterations: int = 800
    """Most Newton iterations of the search for the state after a jump."""

    # joints that slide as a whole
    free_stiffness: float = 1e-9
    """Fraction of the largest eigenvalue of the static stiffness: a direction with less is free. Dovetail: 1e-15 for
    the free direction, -1.6e-6 for the next one, by spin softening."""

    # output
    kept_steps: int = 800
    """Most stored steps of a history; half as many after the steps with the least progress are dropped. A result has
    101 outputs by default; an adaptive history of 1e5 cycles has about 100 steps."""


WEAR = WearOptions()
