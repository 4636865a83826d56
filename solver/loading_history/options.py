"""Tuning constants of the loading history: beginning, steps and restarts of a sweep."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class LoadingOptions:
    """Lengths and limits; each with its meaning, unit (none: a ratio) and the evidence for its value.

    The parameter of a sweep is the frequency, that of a ramp the load factor.
    """

    # where a sweep begins
    begin_away: float = 0.3
    """Of the frequency of the point: how far below it (upwards) or above it (downwards) a sweep begins at least. With
    0.22 and 0.38 the dovetail has the same state within 2e-3."""
    cells_per_octave: int = 4
    """Points of a cell have one first frequency: that of the dovetail, 105 Hz, is half that of its resonance."""
    origin_candidates: int = 8
    """Frequencies of a cell among which the first one is the quietest: they are 2 % apart, and of
    two resonances of the dovetail, 212.9 and 411 Hz, none is nearer than 1 %."""
    first_load_factor: float = 1e-3
    """Load factor at which a ramp begins."""

    # one step
    free_step: float = 1e-3
    """Of the parameter: steps in which a branch that ends is followed through its folds or left to settle in time."""
    search_distance: float = 0.05
    """Of the parameter: natural length of arc-length steps, and how far behind the end of a sweep, and how far apart,
    the sweep is begun anew."""

    # steps of a sweep: dovetail of 48 pairs, against steps twenty times as short. The motion at 211, 211.5, 212 and
    # 212.5 Hz is wrong by 0.25, 0.05, 0.18 and 0.8 % with a largest change of 0.2 (48 nodes in all), by 0.06, 0.04,
    # 0.03 and 0.1 % with 0.05 (155 nodes)
    change_per_rtol: float = 20.0
    """Change of the vibration in a step over its size, over rtol: see above."""
    change_limits: tuple[float, float] = (0.05, 0.2)
    """Limits of that change, see above."""
    small_vibration: float = 0.3
    """Of the friction limits: a smaller vibration has the step of this one. With 1 the motion at 211 Hz is three times
    as wrong, with 0 there are a few nodes more."""
    aimed_change: float = 0.75
    """Of the largest change: what the length of the next step is chosen for. Few steps are refused."""
    lengthening: tuple[float, float] = (0.1, 2.0)
    """Limits of the ratio of the lengths of two steps of a sweep."""
    longest_sweep_step: float = 0.1
    """Of the parameter: longest step."""
    shortest_sweep_step: float = 2e-5
    """Of the parameter: a shorter step is not tried, whatever the change of the vibration is. An undamped slider passes
    its resonance in such steps."""
    node_residual: float = 1e-3
    """Of rtol: scaled residual of a node. With a tenth and ten times as much the dovetail has the same states, to 1e-4
    of the motion; at the tolerance of a result nodes take 1.4 times the iterations."""
    node_iterations: int = 2500
    """Newton iterations from one node to the next, and from a node to a point: three transients of 800."""
    first_iterations: int = 1000
    """Newton iterations of all attempts to begin a sweep, and of those to begin it anew: a joint with a grip takes
    tens to hundreds, one that slips all over as many as it is given."""
    sweep_iterations: int = 8000
    """Newton iterations of a sweep: one that takes more, in jumps and searches, leads nowhere (the dovetail: 300)."""
    nodes_per_save: int = 8
    """Nodes after which the factorisation kept from node to node is given up, so that a sweep can go on from there: a
    factorisation more in eight nodes."""
    iterations_per_report: int = 100
    """Newton iterations after which the progress is handed out: about a second of 48 pairs."""

    # where the first attempt fails
    other_starts: tuple[tuple[int, int], ...] = ((1, 64), (3, 256), (15, 256))
    """Harmonics and samples with which a first state is sought where those of the sweep find none."""
    few_pairs: int = 12
    """Pairs up to which a state that is not accurate is sought from the static one as well: impacts have many
    others."""


LOADING = LoadingOptions()
