"""Other limits of the solver for a hard case, inside a `with` block in Python.

    with solver.tuned(history_iterations=20_000, search_iterations=3000):
        history = solver.march_wear(...)

`TUNABLE` has the names. The file `options.py` of each room holds the constants, with the meaning of each constant and
the evidence for its value.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module

TUNABLE = {
    "COMMON": ("", ("step_error_fraction",)),
    "NEWTON": ("newton", ("iterations", "forcing", "most_directions")),
    "CONTINUATION": ("continuation", ("near_iterations", "search_iterations", "arc_correctors", "load_steps")),
    "ACCURACY": (
        "accuracy",
        ("penetration_limit", "energy_limit", "level_iterations", "refinement_work", "most_samples", "most_unknowns"),
    ),
    "LOADING": (
        "loading_history",
        ("change_limits", "shortest_sweep_step", "sweep_iterations"),
    ),
    "WEAR": (
        "wear",
        (
            "history_iterations",
            "fold_resolution",
            "largest_moved_load",
            "steps_to_the_end",
        ),
    ),
}
"""For each options object: its room, and the constants that may be changed."""


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
    of_name = {name: (room, options) for options, (room, names) in TUNABLE.items() for name in names}
    before = []
    for name, value in values.items():
        if name not in of_name:
            raise ValueError(f"{name}: give one of {', '.join(sorted(of_name))}")
        room, options = of_name[name]
        constants = getattr(import_module(f"solver.{room}.options".replace("..", ".")), options)
        old = getattr(constants, name)
        if isinstance(old, tuple) != isinstance(value, tuple) or isinstance(value, str | bool):
            raise ValueError(f"{name}: give a value like {old!r} instead of {value!r}")
        before.append((constants, name, old))
    try:
        for constants, name, _ in before:
            # the options are frozen: only this function changes them
            object.__setattr__(constants, name, values[name])
        yield
    finally:
        for constants, name, old in before:
            object.__setattr__(constants, name, old)
