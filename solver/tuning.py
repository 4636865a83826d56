"""Other limits of the solver for a hard case, inside a `with` block in Python.

    with solver.tuned(history_iterations=20_000, search_iterations=3000):
        history = solver.march_wear(...)

`TUNABLE` has the names. The file `options.py` of each room holds the constants, with the meaning of each constant and
the evidence for its value.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from solver.accuracy.options import ACCURACY
from solver.continuation.options import CONTINUATION
from solver.loading_history.options import LOADING
from solver.newton.options import NEWTON
from solver.wear.options import WEAR

_NAMES: tuple[tuple[Any, tuple[str, ...]], ...] = (
    (NEWTON, ("iterations", "forcing", "most_directions")),
    (CONTINUATION, ("near_iterations", "search_iterations", "arc_correctors", "load_steps")),
    (ACCURACY, ("penetration_limit", "violation_limit", "refinement_work", "most_samples", "most_unknowns")),
    (LOADING, ("change_limits", "shortest_sweep_step", "sweep_iterations")),
    (
        WEAR,
        ("step_error_fraction", "history_iterations", "fold_resolution", "largest_moved_load", "steps_to_the_end"),
    ),
)
TUNABLE: dict[str, Any] = {name: options for options, names in _NAMES for name in names}
"""For each constant that may be changed, the options to which it belongs."""


@contextmanager
def tuned(**values: float | tuple[float, ...]) -> Iterator[None]:
    """Change constants inside the `with` block, for all threads of the process.

    Parameters
    ----------
    values
        Constants by the names of `TUNABLE`, each of the same type as before.

    Raises
    ------
    ValueError
        No constant has this name, or the value is of another type.
    """
    before = []
    for name, value in values.items():
        if name not in TUNABLE:
            raise ValueError(f"{name}: give one of {', '.join(sorted(TUNABLE))}")
        old = getattr(TUNABLE[name], name)
        if isinstance(old, tuple) != isinstance(value, tuple) or isinstance(value, str | bool):
            raise ValueError(f"{name}: give a value like {old!r} instead of {value!r}")
        before.append((TUNABLE[name], name, old))
    try:
        for constants, name, _ in before:
            # the options are frozen: only this function changes them
            object.__setattr__(constants, name, values[name])
        yield
    finally:
        for constants, name, old in before:
            object.__setattr__(constants, name, old)
