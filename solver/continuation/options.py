"""Tuning constants of the continuation."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ContinuationOptions:
    """Step lengths and limits of effort; each with its meaning, unit (none: a ratio) and the evidence for its value.

    A state that is found is exact to the tolerance whatever they are. The *change* of the vibration is
    `vibration_change` of two states, relative to the first one.
    """

    # shared
    near_iterations: int = 10
    """Newton iterations from a near state, where a shorter step is the alternative. Of 1400 such solves that converged
    (impacts, sliders, random scenes, dovetail) eight took all ten."""
    smooth_change: float = 0.2
    """Change over one smooth step of a branch. More is divided; at a fold more is a jump, less a corner. Half as much
    takes up to half as many iterations more, twice as much leads to the same states."""

    # natural steps
    linear_change: float = 1.0
    """Change over a step that is not divided where nothing slips or opens at its ends: the reversal of phase at a
    linear resonance is 2."""
    shortest_fraction: float = 1.0 / 64.0
    """Of the range to the target: where a shorter step is needed the branch is taken to fold."""
    natural_failures: int = 25
    """Steps that do not converge: a branch with many corners is left to arc length. With half as many the dovetail has
    no static state at a friction coefficient of 1000."""
    target_round_off: float = 1e-9
    """Of the range: a step that ends so near to the target ends at it."""

    # arc length, in unknowns over the size of the first predicted force
    arc_steps: int = 250
    """Steps of one continuation."""
    arc_failures: int = 80
    """Correctors that do not converge, in all."""
    arc_iterations: int = 8
    """Newton iterations of a corrector. Half and twice as many take a quarter and 40 % more in all through the folds of
    vibro-impact."""
    arc_wander: float = 4.0
    """Of the length of the step: distance from its start at which a corrector is given up."""
    first_arc: float = 0.02
    """Length of the first step."""
    longest_arc: float = 0.2
    """Length of a step, at most."""
    shortest_arc: float = 1e-4
    """Length from which no shorter step is tried: the branch has a corner."""
    renewed_arc: float = 1e-3
    """Length with which the steps go on behind a corner."""
    arc_growth: float = 1.6
    """Of the length, after each step that was found; it is halved after one that was not. With 3.2 the folds of
    vibro-impact take a fifth fewer iterations and move by 1e-4."""
    farthest: float = 10.0
    """Natural lengths of the parameter from start and target at which the search ends."""
    parameter_difference: float = 1e-7
    """Natural lengths: step of the difference that is the derivative of the residual, to 1e-9 of it."""
    corner_arcs: tuple[float, ...] = (1e-2, 1e-3, 1e-4)
    """Lengths ahead at which the tangent behind a corner of the branch is taken."""
    backward_cosine: float = 0.99
    """Cosine to the backward tangent above which a point is one of the piece before the corner."""
    target_distance: float = 2.0
    """Chords between the neighbours that the state at the target may lie from the chord."""
    target_slack: float = 1e-6
    """Of the size of the predicted force, added to that distance: chords may be as short as round-off."""
    fold_points: int = 3
    """Points added around a fold. One moves a fold of vibro-impact by 1e-3, six move it by 2e-4."""
    vertex_reach: float = 0.9
    """Of the distance to a neighbour: the vertex of the parabola through a fold is taken no farther."""
    vertex_resolution: float = 1e-3
    """Of the distance between both neighbours: nearer to the middle point the vertex adds nothing."""
    vertex_offset: float = 0.1
    """Of the distance to the farther neighbour: where a point is added instead."""

    # first state
    load_steps: int = 20
    """Steps of the static load, on whose history the state may depend: that of the dovetail is the same with 10, 40."""
    load_step_iterations: int = 5
    """Newton iterations of one from the last state, grown with its load. Without gaps and wear they take 0 or 1."""
    relief: tuple[float, ...] = (0.1, 0.4)
    """Fractions of the static friction forces removed where the excitation cannot be raised with all of them. Others
    lead to other states of the family that friction allows: 5 % for a mass that ratchets."""
    load_length: float = 0.2
    """Natural length of the load factor of the excitation."""

    # homotopies
    moderate_friction: float = 1.0
    """Friction coefficient up to which one static state was found for all joints, from any start. From 0.5 the dovetail
    has the same states; from 2 they take 60 iterations more."""
    friction_reduction: float = 0.5
    """Of the friction coefficient, from one attempt to the next."""
    friction_attempts: int = 5
    """Attempts: the last one with a sixteenth of the friction."""
    cold_iterations: int = 60
    """Newton iterations from no state at all: pairs begin to slip one by one."""

    # relaxation in time; changes are those of all amplitudes, over the larger ones
    transient_steps: int = 120
    """Steps of one relaxation."""
    transient_effort: int = 800
    """Newton iterations of one relaxation, those for the periodic state included: a fall behind a fold of vibro-impact
    takes 400 to 500, and what does not settle (16 pairs of a blade that slips and lifts all over) thousands."""
    transient_tolerance: float = 1e-6
    """Scaled residual of a step, which is no result."""
    shortest_transient: float = 1.0 / 64.0
    """Periods: only where Newton's method fails is a step shorter than one, for amplitudes have no meaning there."""
    longest_transient: float = 1e9
    """Periods: as good as infinite, the harmonic balance itself."""
    wanted_change: float = 0.25
    """Change over a step that is aimed at."""
    largest_change: float = 0.6
    """Change over a step from which it is repeated with `transient_cut` of its length."""
    transient_cut: float = 0.35
    """Of the length, see `largest_change`. With half of it a fall behind a fold takes 2.5 times the iterations."""
    transient_growth: tuple[float, float] = (0.5, 2.5)
    """Limits of the ratio of two lengths."""
    relaxed_change: float = 0.02
    """Change over a step below which a periodic state is sought."""
    renewed_attempt: float = 0.3
    """Of the change at the last attempt: below it the periodic state is sought again."""
    relaxed_distance: float = 0.1
    """Of the motion: a periodic state farther from it than that is another one."""
    runaway: float = 1e3
    """Mean relative displacement over the largest one of vibration and start, from which parts run away."""

    # ratcheting and states after a fold
    shakedown_steps: int = 30
    """Shifts of the mean positions. Each takes away two thirds of the ratcheting or more, as measured, in one to six
    iterations."""
    fold_search_length: float = 0.01
    """Natural length of the frequency, over the frequency."""


CONTINUATION = ContinuationOptions()
