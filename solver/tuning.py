"""Limits of the solver that a hard case may need otherwise, changed from Python for what is computed inside.

    with solver.tuned(history_iterations=20_000, jump_iterations=3000):
        history = solver.march_wear(...)

`TUNABLE` has the names. Each constant stands in the file `options.py` of its room, with its meaning and with the number
or the case that chose its value.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module

TUNABLE = {
    "NEWTON": ("newton", ("iterations", "forcing", "exact_directions")),
    "CONTINUATION": ("continuation", ("arc_iterations", "load_steps", "transient_effort", "longest_transient")),
    "ACCURACY": (
        "accuracy",
        ("penetration_limit", "energy_limit", "level_iterations", "refinement_work", "most_samples", "most_unknowns"),
    ),
    "LOADING": (
        "loading_history",
        ("change_limits", "shortest_sweep_step", "first_iterations", "node_iterations", "sweep_iterations"),
    ),
    "WEAR": (
        "wear",
        (
            "step_error_fraction",
            "step_iterations",
            "history_iterations",
            "jump_iterations",
            "fold_resolution",
            "largest_moved_load",
            "steps_to_the_end",
        ),
    ),
}
"""Options by their name: room, and the constants that may be changed."""


@contextmanager
def tuned(**values: float | tuple[float, ...]) -> Iterator[None]:
    """Other constants for what is computed inside the `with` block, in all threads of the process.

    Parameters
    ----------
    values
        By the names of `TUNABLE`; of the kind of the constant.

    Raises
    ------
    ValueError
        Where no constant has the name, or the value is of another kind.
    """
    of_name = {name: (room, options) for options, (room, names) in TUNABLE.items() for name in names}
    before = []
    for name, value in values.items():
        if name not in of_name:
            raise ValueError(f"{name}: give one of {', '.join(sorted(of_name))}")
        room, options = of_name[name]
        constants = getattr(import_module(f"solver.{room}.options"), options)
        old = getattr(constants, name)
        if isinstance(old, tuple) != isinstance(value, tuple) or isinstance(value, str | bool):
            raise ValueError(f"{name}: give a value like {old!r} instead of {value!r}")
        before.append((constants, name, old))
    try:
        for constants, name, _ in before:
            # frozen for everybody else
            object.__setattr__(constants, name, values[name])
        yield
    finally:
        for constants, name, old in before:
            object.__setattr__(constants, name, old)
