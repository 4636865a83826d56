"""A user's script, which mypy checks with the packages and nobody runs: an error it no longer finds is one, too."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from fretwear import (
    Outcome,
    ReducedModel,
    SolverSettings,
    Study,
    build_model,
    build_scene,
    frequency_response,
    march_wear,
    open_result,
    read_scene,
    read_study,
    run_study,
    worn_volume_statistics,
)

study: Study = read_study("sdof_slider", {"axes.frequency": [150.0]})
result: xr.Dataset = run_study(study, "out.nc", fresh=True)
result = open_result("out.nc")
model: ReducedModel = build_scene("sdof_slider", normal_load=12.0)
model = read_scene("root.h5")
model = build_model([[1.0]], None, [[1.0]], [[-1, 0, -1]], 1e-4, load_harmonic=[1.0], normal_load=1.0)
settings = SolverSettings(harmonics=5, rtol=1e-3)
response: NDArray[np.complex128] = frequency_response(model, [0.1], 1.0, 0.5, sweep="down", settings=settings).response
history = march_wear(model, 0.1, 1.0, [0.5], 1e-11, np.linspace(0.0, 10.0, 3))
outcome: Outcome = history.outcome
dataset: xr.Dataset = history.to_xarray()
statistics: xr.Dataset = worn_volume_statistics(result)
wrong: str = run_study(study)  # type: ignore[assignment]
run_study(3)  # type: ignore[arg-type]
frequency_response(model, [0.1], 1.0, 0.5, sweep="sideways")  # type: ignore[arg-type]
