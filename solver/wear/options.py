"""Tuning constants of the integration over the slow time: steps, their limits, loss of a branch, output."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class WearOptions:
    """Lengths and limits; each with its meaning, unit (none: a ratio) and the evidence for its value."""

    # adaptive steps
    step_error_fraction: float = 0.5
    """Of rtol: error of a step over what it has worn, or would have worn at the mean rate so far."""
    largest_step_ratio: float = 2.0
    """Of two steps; BDF2 is zero-stable below 1 + sqrt(2)."""
    smallest_step_ratio: float = 0.25
    """By which a step is cut whose end was not found; one that was refused is not cut by more."""
    step_safety: float = 0.85
    """Of the length at which the error would be the one allowed."""
    refused_step_ratio: float = 0.8
    """A step that was refused is cut by at least so much, one that was taken by at most."""
    first_step: float = 0.05
    """Of the explicit step limit: length of the first step, before anything is known of its error."""
    first_depth: float = 0.01
    """Of the largest relative motion: what the first step wears at most."""
    shortest_slow_step: float = 1e-4
    """Of the first step."""
    step_iterations: int = 10
    """Newton iterations of a step: one that takes more is shortened. What a march may spend grows by them each step."""

    # Euler steps
    arnoldi_products: int = 16
    """Linear solves for the limit of the explicit step."""
    largest_moved_load: float = 10.0
    """Of the normal forces, in their norm, that a step may move; with less the error of the worn volume tells (27 %
    with 0.6)."""
    advised_moved_load: float = 0.1
    """Of the normal forces, of a step that is advised: the usual one of the dovetail root moves 0.001 to 0.01."""

    # history
    history_iterations: int = 3000
    """Newton iterations of a history beside `step_iterations` for each step, and of its reference solution beside those
    of the history: more lead nowhere. A travelling wave at its resonance: 1400 in a corner within 500 cycles."""
    iterations_per_save: int = 100
    """Newton iterations after which the factorisation kept from step to step is given up, so that a march can be kept
    on disk and go on to the same numbers; one factorisation in so many iterations costs next to nothing."""
    left_out_grown: float = 1.5
    """Part of the contact force in harmonics that are left out, over that for which harmonics were chosen, from which
    on they may be chosen again. Dovetail, 211.5, 211.75, 212.5 Hz: it stays within 0.8 to 1.4 over 1e5 cycles."""
    left_out_fallen: float = 0.2
    """The same, below which fewer harmonics are tried."""
    alternations: int = 4
    """Increments of a wear rate that alternate in sign and do not shrink, from where on the rate oscillates."""
    noticeable_oscillation: float = 1e-3
    """Of the largest wear rate of the joint: smaller increments are no oscillation."""
    calming: float = 0.98
    """Increment over the one before, below which an oscillation calms."""
    oscillation_round_off: float = 1e-9
    """Of the wear rate if all pairs slipped as far as they move: smaller changes are no oscillation."""
    no_wear: float = 1e-12
    """Of the same: a joint that wears less sticks."""

    # steady state
    steady_rate: float = 0.01
    """Relative change of the wear rate of a joint that slips everywhere, over the last nine tenths of its worn volume,
    below which it has become steady and does not end."""
    acted_back: float = 100.0
    """Of the normal force of a pair: what its depth would move by itself, all others held, before a rate counts as
    steady: less may not have acted back on the joint yet. Long waves of n pairs are about n times as soft."""
    bears: float = 1e-9
    """Of the largest normal force: a pair with less does not bear the joint."""
    steps_to_the_end: int = 20_000
    """Of a march that comes to no end; a joint takes 2 to 10 steps a pair."""
    longest_march: float = 1e25
    """Cycles, the same."""

    # final state without slow time
    off_margin: float = 10.0
    """Of the overlap of all pairs, each as if it alone gave way: how far a pair is taken off, so that it stays open
    while others are taken off; what comes out does not depend on it."""
    off_tolerance: float = 1e-3
    """Of the tolerance of a state: depths are read from this one, which takes an iteration more (a sphere: 3e-6 of its
    depth off without it)."""
    off_attempts: int = 4
    """With ten times the margin each."""
    loss_of_rate: float = 0.5
    """Of what its own wear changes of the wear rate of a pair, that the wear of the others may take of it: more, and it
    may stick again. A cylinder in partial slip: they add 0.4 to 0.9; a sphere: they take 0.2 at the edge of the stick
    zone unworn, and add later."""
    same_depth: float = 1e-3
    """Of the deepest pair, by how much the final depths may differ with the friction that another way leaves."""
    tested_states: int = 3
    """Between the unworn and the final state, the first included, at which this is tested."""

    # loss of a branch
    fold_resolution: float = 0.01
    """Of the cycle count: how exactly the end of a branch is found."""
    smallest_fold_resolution: float = 2.0**-10
    """Of a step: the same, at the finest."""
    jump_change: float = 0.05
    """Relative change of the vibration beyond the end of a branch that is a jump: corners at which the branch folds
    back a little are none, and there may be many of them."""
    jump_iterations: int = 800
    """Newton iterations of the search for the state behind a jump: one that takes more leads nowhere."""

    # joints that slide all over
    free_stiffness: float = 1e-9
    """Of the largest eigenvalue of the static stiffness: a direction with less is free. Of the dovetail the free one
    has 1e-15, the next one, by spin softening, -1.6e-6."""
    free_closing: float = 1e-6
    """Largest closing part of a free direction of norm 1: sliding closes nothing."""

    # output
    kept_steps: int = 800
    """Steps of a history to the steady state that are kept to be read, at most; half as many after those that go the
    least way were left out. A result has 101 outputs by default."""
    course_steps: int = 256
    """Ends of steps at which a history is compared with its reference solution, at most; an adaptive history of 1e5
    cycles has about 100."""


WEAR = WearOptions()
