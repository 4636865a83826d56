"""Tuning constants of the loading history: origin, steps and restarts of a sweep."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class LoadingOptions:
    """Lengths and limits; each with its meaning, unit (none: a ratio) and the evidence for its value.

    The parameter of a sweep is the frequency, that of a ramp the load factor.
    """

    # origin
    begin_below: float = 0.7
    """Frequency that a sweep upwards begins below, over that of the point (0.62 and 0.78 give the same state of the
    dovetail within 2e-3)."""
    begin_above: float = 1.3
    """The same above, of a sweep downwards."""
    cells_per_octave: int = 4
    """Points of a cell have one origin."""
    origin_candidates: int = 8
    """Frequencies of a cell among which the origin is the quietest."""
    first_load_factor: float = 1e-3
    """Load factor at which a ramp begins."""

    # one step
    free_step: float = 1e-3
    """Of the parameter: steps that are taken however much the vibration changes and wherever the branch ends."""
    arc_span: float = 0.05
    """Of the parameter: natural length of arc-length steps."""
    most_folds: int = 6
    """Ends of branches within a step."""

    # steps of a sweep
    change_per_rtol: float = 20.0
    """Change of the vibration in a step over its size, over rtol. TODO evidence."""
    change_limits: tuple[float, float] = (0.05, 0.2)
    """Limits of that change."""
    small_vibration: float = 0.3
    """Of the friction limits."""
    aimed_change: float = 0.75
    """Of that change: what the length of the next step is chosen for."""
    lengthening: tuple[float, float] = (0.1, 2.0)
    """Limits of the ratio of the lengths of two steps of a sweep."""
    longest_step: float = 0.1
    """Of the parameter: longest step."""
    shortest_step: float = 2e-5
    """Of the parameter: a shorter step is not tried, whatever the change of the vibration is."""
    node_residual: float = 1e-3
    """Of rtol: scaled residual of a node."""
    node_iterations: int = 2500
    """Newton iterations from one node to the next, and from a node to a point."""
    first_iterations: int = 1000
    """Newton iterations of all attempts to begin a sweep, and of those to begin it anew: a joint with a grip takes
    tens to hundreds, one that slips all over as many as it is given."""
    sweep_iterations: int = 8000
    """Newton iterations of a sweep: one that takes more, in jumps and searches, leads nowhere (the dovetail: 1500)."""
    nodes_per_save: int = 8
    """Nodes after which the factorisation kept from node to node is given up: a sweep can go on from there."""
    iterations_per_report: int = 100
    """Newton iterations after which the progress is handed out."""

    # restarts
    restart_distance: float = 0.05
    """Of the frequency: how far behind the end of a sweep, and how far apart, it is begun anew."""
    most_restarts: int = 6
    """Attempts to begin it anew."""
    other_starts: tuple[tuple[int, int], ...] = ((1, 64), (3, 256), (15, 256))
    """Harmonics and samples with which a first state is sought where those of the sweep find none."""
    few_pairs: int = 12
    """Pairs up to which a state that is not accurate is sought from the static one as well: impacts have many
    others."""


LOADING = LoadingOptions()
