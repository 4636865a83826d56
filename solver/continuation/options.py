"""Tuning constants of the continuation: meaning, unit, evidence."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ContinuationOptions:
    """Step lengths and limits of effort; a state that is found is exact to the tolerance whatever they are.

    *Change of the vibration*: `vibration_change` of two states, relative to the first one.
    """

    # --- shared ---
    # Iterations of a Newton solve from a near state, where a shorter step is the alternative.
    near_iterations: int = 10
    # Change of the vibration over one smooth step of a branch. More is divided; at a fold more is a jump and less a
    # corner of the branch.
    smooth_change: float = 0.2

    # --- natural steps (natural) ---
    # Change of the vibration over a step that is not divided where nothing slips or opens at both ends: less than
    # the reversal of phase at a linear resonance, which is 2.
    linear_change: float = 1.0
    # Shortest step, over the range to the target: below it the branch is taken to fold.
    shortest_fraction: float = 1.0 / 64.0
    # Steps, and steps that may fail: a branch with many corners is left to arc length.
    natural_steps: int = 600
    natural_failures: int = 25
    # Distance to the target, over the range, that is round-off.
    target_round_off: float = 1e-9

    # --- arc length (arc_length); lengths are in unknowns scaled to the size of the first predicted force ---
    # Steps, and correctors that may fail in all.
    arc_steps: int = 250
    arc_failures: int = 80
    # Iterations of a corrector, and distance from its start, over the length of the step, at which it is given up.
    arc_iterations: int = 8
    arc_wander: float = 4.0
    # First and longest length of a step, shortest one that is tried, and length that follows one shorter than that.
    first_arc: float = 0.02
    longest_arc: float = 0.2
    shortest_arc: float = 1e-4
    renewed_arc: float = 1e-3
    # Factor of the length after a step that was found.
    arc_growth: float = 1.6
    # Distance from start and target, in natural lengths of the parameter, at which the search ends.
    farthest: float = 10.0
    # Difference of the parameter, in natural lengths, for the derivative of the residual. Round-off of the residual
    # over it is 1e-9; the derivative is used for directions only.
    parameter_difference: float = 1e-7
    # Lengths at which the tangent behind a corner of the branch is taken.
    corner_arcs: tuple[float, ...] = (1e-2, 1e-3, 1e-4)
    # Cosine to the backward tangent from which a point behind a corner is one on the old piece.
    backward_cosine: float = 0.99
    # Iterations for the state at the target, and its distance from the chord between the neighbours: in lengths of the
    # chord, plus a part of the size of the predicted force.
    target_iterations: int = 15
    target_distance: float = 2.0
    target_slack: float = 1e-6
    # Points added around a fold; the frequency of a fold is then the same to 1e-4 from wherever the branch is followed
    # (tests/solver/test_continuation).
    fold_points: int = 3
    # Farthest vertex of the parabola, over the distance of the neighbour; nearest one, over that of both neighbours;
    # place of the point instead of a nearer one, over the distance of the farther neighbour.
    fold_reach: float = 0.9
    fold_resolution: float = 1e-3
    fold_offset: float = 0.1

    # --- first state (first_state) ---
    # Steps of the static load, and Newton iterations of one from the last state, grown with its load.
    load_steps: int = 20
    load_step_iterations: int = 5
    # Fractions of the static friction forces that are removed where the excitation cannot be raised with all of them.
    relief: tuple[float, ...] = (0.1, 0.4)
    # Natural length of the load factor of the excitation.
    load_length: float = 0.2

    # --- homotopies (homotopy) ---
    # Friction coefficient up to which one static state was found for all joints and starts, from any start.
    moderate_friction: float = 1.0
    # Factor of the friction coefficient from one attempt to the next, and the number of attempts.
    friction_reduction: float = 0.5
    friction_attempts: int = 5
    # Newton iterations from no state at all: pairs begin to slip one by one.
    cold_iterations: int = 60

    # --- relaxation in time (transient); changes are those of all amplitudes over a step, over the larger state ---
    # Steps, and steps that may fail.
    transient_steps: int = 120
    transient_failures: int = 60
    # Iterations and scaled residual of a step, which is no result.
    transient_iterations: int = 12
    transient_tolerance: float = 1e-6
    # Shortest and longest step, periods: the first where Newton's method fails only, the other one is no limit.
    shortest_transient: float = 1.0 / 64.0
    longest_transient: float = 1e9
    # Change that is aimed at, and the one from which a step is repeated with `transient_cut` of its length.
    wanted_change: float = 0.25
    largest_change: float = 0.6
    transient_cut: float = 0.35
    # Limits of the factor from one length to the next.
    transient_growth: tuple[float, float] = (0.5, 2.5)
    # Change below which a periodic state is sought, and fraction of it below which it is sought again.
    relaxed_change: float = 0.02
    renewed_attempt: float = 0.3
    # Difference of a periodic state from the motion at that time, over its size, above which it is another one.
    relaxed_distance: float = 0.1
    # Mean relative displacement, over the largest one of vibration and start, from which the parts run away.
    runaway: float = 1e3

    # --- shakedown (ratcheting) and states after a fold (after_fold) ---
    # Moves of the mean positions, each of which takes away two thirds of the ratcheting or more (measured on random
    # scenes), in one to six iterations.
    shakedown_steps: int = 30
    # Natural length of the frequency, over the frequency.
    fold_search_length: float = 0.01


CONTINUATION = ContinuationOptions()
