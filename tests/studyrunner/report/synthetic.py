"""Result files whose errors are known: worn volume and response by a formula of the settings."""

import itertools
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from studyrunner.report.reading.result import Result

CYCLES = (0.0, 500.0, 1000.0)
WORN = 2e-9
AMPLITUDE = 3e-3

STUDY = """[study]
name = "synthetic"
[solver]
harmonics = "auto"
samples = "auto"
tolerance = 1e-8
rtol = {rtol}
shortcuts = {shortcuts}
"""

Point = Mapping[str, float | str]
Formula = Callable[[Point], float]


def synthetic(
    axes: Mapping[str, Sequence[float | str]],
    error: Formula,
    time: Formula,
    *,
    response_error: Formula | None = None,
    exact: bool = False,
    estimate: Formula = lambda _: 0.0,
    outcome: Formula = lambda _: 0,
    limit: float = np.inf,
    worn: float = WORN,
    rtol: float = 1e-3,
    shortcuts: str = "true",
) -> Result:
    """A file with these axes. error, response_error: signed, relative, at the last cycle; half of it in between."""
    whole = {"frequency": [100.0], "wear_coefficient": [1e-11], "step": [10.0], "scheme": ["implicit"]} | dict(axes)
    names, shape = list(whole), tuple(len(values) for values in whole.values())
    history = np.array([0.0, 0.4, 1.0])
    variables = {name: np.full((*shape, 3), np.nan) for name in ("worn_volume", "response_error")}
    amplitude = np.full((*shape, 3, 1), np.nan)
    plain = {name: np.zeros(shape) for name in ("run_time", "error_estimate", "step_limit")}
    flags = {name: np.zeros(shape, np.int8) for name in ("outcome",)}
    for place in itertools.product(*(range(size) for size in shape)):
        point = {name: whole[name][index] for name, index in zip(names, place, strict=True)}
        flags["outcome"][place] = outcome(point)
        plain["run_time"][place] = time(point)
        plain["step_limit"][place] = limit
        if outcome(point):
            continue
        share = np.array([0.0, 0.5, 1.0])
        variables["worn_volume"][place] = worn * history * (1.0 + error(point) * share)
        amplitude[place] = (AMPLITUDE * (1.0 + (response_error or error)(point) * share))[:, None]
        variables["response_error"][place] = estimate(point)
        plain["error_estimate"][place] = estimate(point)
    data = {name: ((*names, "cycle"), values) for name, values in variables.items()}
    data |= {name: (names, values) for name, values in (plain | flags).items()}
    data["response_amplitude"] = ((*names, "cycle", "response"), amplitude)
    if exact:
        data["exact_worn_volume"] = ((*names, "cycle"), np.broadcast_to(worn * history, (*shape, 3)))
        exact_response = np.full((*shape, 3, 1), AMPLITUDE)
        data["exact_response_amplitude"] = ((*names, "cycle", "response"), exact_response)
    dataset = xr.Dataset(
        data,
        coords={
            **{name: list(values) for name, values in whole.items()},
            "cycle": list(CYCLES),
            "contact": [0],
            "response": ["tip"],
        },
    )
    dataset["outcome"].attrs = {"flag_values": np.array([0, 4], np.int8), "flag_meanings": "converged march_failed"}
    dataset.attrs["study"] = STUDY.format(rtol=rtol, shortcuts=shortcuts)
    return Result(Path("synthetic.nc"), dataset)
