"""What a result file holds of a point of a nonlinear mode."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from solver.results.mode_values import ModeValues
from studyrunner.plan.results import MarchResult
from studyrunner.plan.tasks import MarchTask


def build_mode_result(task: MarchTask, point: ModeValues) -> MarchResult:
    """The result of a task that reports a point of a nonlinear mode."""
    values: Mapping[str, object] = {
        "natural_frequency": point.frequency,
        "natural_frequency_error": point.frequency_error,
        "damping_ratio": point.damping_ratio,
        "damping_ratio_error": point.damping_error,
        "response_amplitude": np.abs(point.response),
        "response_phase": np.angle(point.response),
        "slip_fraction": point.slip_fraction,
        "open_fraction": point.open_fraction,
        "harmonics_used": point.harmonics_used,
        "samples_used": point.samples_used,
    }
    kept = {
        "outcome": int(point.outcome),
        "newton_iterations": point.newton_iterations,
        "run_time": point.run_time,
        "message": point.message,
    }
    return MarchResult(task.points, {**{name: values[name] for name in task.variables}, **kept})
