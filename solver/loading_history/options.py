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
    history_change_per_rtol: float = 10.0
    """Change of the tangential history in a step over the friction limits, over rtol. On the dovetail beside its
    resonance, where it matters most, 0.2 leaves the wear rate wrong by 0.5 %, 0.1 by 0.2 %, 0.02 by 0.1 %."""
    smallest_history_change: float = 0.02
    """Lower limit of that change: smaller ones take hundreds of nodes."""
    largest_history_change: float = 0.1
    """Upper limit of that change: larger ones miss the states in which pairs let go, and are sought more than once.
    Root of the deck `blade_root`, rtol 5e-2: 0.2 leaves the wear rate wrong by 3.6 % for 2545 iterations, 0.1 by 0.15 %
    for 1993, 0.05 by 0.02 % for 2921."""
    aimed_history_change: float = 0.9
    """Of that change: what the length of the next step is chosen for."""
    most_growth: float = 1.5
    """Of the rate at which the history changes, from one step to the next: as far as it is foreseen (160 pairs, to the
    resonance: 20 of 82 steps are sought more than once, 37 without)."""
    longest_sweep_step: float = 0.03
    """Of the parameter: longest step where nothing slips."""
    shortest_sweep_step: float = 2e-5
    """Of the parameter: a shorter step is not tried, whatever the change of the history is."""
    most_lengthening: float = 2.0
    """Upper limit of the ratio of the lengths of two steps of a sweep."""
    most_shortening: float = 0.3
    """The same, as a lower limit of the ratio."""
    many_nodes: int = 300
    """From here on the shortest step grows with the square of the number of nodes: no sweep takes for ever."""
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
