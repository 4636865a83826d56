"""Tuning constants of the continuation."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ContinuationOptions:
    """Step lengths and budgets, each with its meaning, unit (none: a ratio) and the evidence for its value.

    A state that is found is exact to the tolerance for all values of the options. The *change* of the vibration is
    `vibration_change` of two states, relative to the first state.
    """

    # shared
    near_iterations: int = 10
    """Newton iterations from a near state, where a shorter step is the alternative. Of 1400 such converged solves
    (impacts, sliders, random scenes, dovetail) eight needed all ten."""
    smooth_change: float = 0.2
    """Largest change over a smooth step of a branch. A step with a larger change is divided. A fold with a larger
    change is a jump, with a smaller change a corner. Half the value takes up to 50 % more iterations; twice the
    value leads to equal states."""

    # natural steps
    linear_change: float = 1.0
    """Largest change over a step between two states in which no pair slips or opens. The reversal of phase at a linear
    resonance is a change of 2."""
    shortest_fraction: float = 1.0 / 64.0
    """Shortest step over the range to the target. Where a shorter step is needed, the branch is assumed to fold."""
    natural_failures: int = 25
    """Steps that may fail to converge; a branch with more corners is left to arc length. With half the number no static
    state of the dovetail is found at a friction coefficient of 1000."""
    target_round_off: float = 1e-9
    """Distance to the target over the range. A step that ends nearer to the target ends at the target."""

    # arc length, in unknowns divided by the norm of the first predicted force
    arc_steps: int = 250
    """Largest number of steps of one continuation."""
    arc_failures: int = 80
    """Correctors that may fail to converge, in one continuation."""
    arc_iterations: int = 8
    """Newton iterations of a corrector. Through the folds of vibro-impact half the number takes 25 % more iterations in
    total, twice the number 40 % more."""
    arc_wander: float = 4.0
    """Distance of a corrector from its start over the length of the step, above which the corrector is given up."""
    first_arc: float = 0.02
    """Length of the first step."""
    longest_arc: float = 0.2
    """Largest length of a step."""
    shortest_arc: float = 1e-4
    """Shortest length of a step. Where no such step converges, the branch has a corner."""
    renewed_arc: float = 1e-3
    """Length of the first step behind a corner."""
    arc_growth: float = 1.6
    """Factor of the length after a converged step; after a failed step the length is halved. With 3.2 the folds of
    vibro-impact take a fifth fewer iterations and move by 1e-4."""
    farthest: float = 10.0
    """Natural lengths of the parameter from start and target at which the search ends."""
    parameter_difference: float = 1e-7
    """Natural lengths: step of the finite difference of the residual, whose relative error is 1e-9."""
    corner_arcs: tuple[float, ...] = (1e-2, 1e-3, 1e-4)
    """Lengths ahead of a corner at which the tangent behind the corner is taken."""
    backward_cosine: float = 0.99
    """Cosine to the backward tangent above which a point lies on the branch before the corner."""
    target_distance: float = 2.0
    """Largest distance of the state at the target from the chord between its neighbours, over this chord."""
    target_slack: float = 1e-6
    """Addition to that distance, over the norm of the predicted force: chords may be as short as round-off."""
    fold_points: int = 3
    """Points added around a fold. One moves a fold of vibro-impact by 1e-3, six move it by 2e-4."""
    vertex_reach: float = 0.9
    """Farthest vertex of the parabola through a fold, over the distance to a neighbour."""
    vertex_resolution: float = 1e-3
    """Distance of a vertex to the middle point over the distance of both neighbours; a nearer vertex adds nothing."""
    vertex_offset: float = 0.1
    """Place of the point that is added instead of such a vertex, over the distance to the farther neighbour."""

    # first state
    load_steps: int = 20
    """Steps of the static load, which may change the state. The state of the dovetail is unchanged with 10 and 40."""
    load_step_iterations: int = 5
    """Newton iterations of a load step from the last state, scaled with the load. Without gaps and wear: 0 or 1."""
    relief: tuple[float, ...] = (0.1, 0.4)
    """Fractions of the static friction forces that are removed where the excitation cannot be raised with the full
    forces. Other fractions lead to other states that friction allows: 5 % for a mass that ratchets."""
    load_length: float = 0.2
    """Natural length of the load factor of the excitation."""

    # homotopies
    moderate_friction: float = 1.0
    """Friction coefficient up to which one static state was found for all joints, from any start. With 0.5 the states
    of the dovetail are unchanged; with 2 they take 60 iterations more."""
    friction_reduction: float = 0.5
    """Factor of the friction coefficient from one attempt to the next."""
    friction_attempts: int = 5
    """Attempts; the last attempt has a sixteenth of the friction."""
    cold_iterations: int = 60
    """Newton iterations without a known state: pairs begin to slip one by one."""

    # relaxation in time; a change is the norm of the change of the amplitudes over the larger norm of two motions
    transient_steps: int = 120
    """Largest number of steps of one relaxation."""
    transient_effort: int = 800
    """Budget of Newton iterations of one relaxation, including the iterations for the periodic state. A jump at a fold
    of vibro-impact takes 400 to 500. A motion that does not settle (a blade whose 16 pairs all slip and lift) would
    take thousands."""
    transient_tolerance: float = 1e-6
    """Scaled residual of a step. A step is no result, so that a loose tolerance is enough."""
    shortest_transient: float = 1.0 / 64.0
    """Periods: shortest step. Amplitudes have no meaning below one period: only where Newton's method fails."""
    longest_transient: float = 1e9
    """Periods: longest step. It is practically infinite: the step is the harmonic balance itself."""
    wanted_change: float = 0.25
    """Wanted change over a step."""
    largest_change: float = 0.6
    """Change over a step above which the step is repeated with `transient_cut` of its length."""
    transient_cut: float = 0.35
    """Factor of the length, see `largest_change`. Half the value takes 2.5 times the iterations of a jump at a fold."""
    transient_growth: tuple[float, float] = (0.5, 2.5)
    """Limits of the ratio of two successive lengths."""
    relaxed_change: float = 0.02
    """Change over a step below which a periodic state is sought."""
    renewed_attempt: float = 0.3
    """Change over the change at the last attempt, below which the periodic state is sought again."""
    relaxed_distance: float = 0.1
    """Distance of a periodic state from the motion, over the motion; a farther state belongs to another motion."""
    runaway: float = 1e3
    """Mean relative displacement over the largest displacement of vibration and start; above it parts run away."""

    # ratcheting and states after a fold
    shakedown_steps: int = 30
    """Largest number of shifts of the mean positions. Each shift removes at least two thirds of the ratcheting
    (measured), in one to six iterations."""
    fold_search_length: float = 0.01
    """Natural length of the frequency in the search behind a fold, over the frequency."""


CONTINUATION = ContinuationOptions()
