"""Stand-ins for the solver: results of the right shapes whose numbers tell which task made them."""

from __future__ import annotations

import time

import numpy as np

from studyrunner.results import BranchResult, MarchResult
from studyrunner.scene import SceneFacts
from studyrunner.tasks import BranchTask, MarchTask
from studyrunner.variables import ASKED

FACTS = SceneFacts(
    n_displacements=6,
    position=np.array([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]),
    area=np.array([1e-4, 2e-4]),
    surface=("intrados", "extrados"),
    response_names=("tip",),
    digest="0" * 64,
)


def fake_evaluate(
    task: BranchTask | MarchTask, facts: SceneFacts = FACTS, seconds: float = 0.0
) -> BranchResult | MarchResult:
    """A result that depends on everything in the task but its cost; takes up to `seconds`, unevenly."""
    if isinstance(task, BranchTask):
        settings = (task.settings.harmonics, task.settings.samples, task.settings.tolerance)
        starts = tuple(
            (frequency, task.excitation_amplitude, task.sweep == "up", *settings) for frequency in task.frequencies
        )
        return BranchResult(starts=starts, activity=tuple(1.0 / frequency for frequency in task.frequencies))
    assert isinstance(task.start, tuple)
    fingerprint = float(np.dot(task.start, [1.0, 0.1, 0.01, 1e-3, 1e-5, 1.0]))
    fingerprint += task.wear_coefficient * 1e9 + task.step * 1e-4 + 0.5 * (task.scheme == "implicit")
    pause = seconds * (fingerprint * 7.7 % 1.0) ** 2
    time.sleep(pause)
    sizes = {"contact": len(facts.area), "response": len(facts.response_names)}
    values = {}
    for name in task.variables:
        shape = (len(task.cycles), *(sizes[dimension] for dimension in ASKED[name].dimensions[1:]))
        values[name] = fingerprint + np.arange(float(np.prod(shape))).reshape(shape)
    return MarchResult(task.points, 0, values, np.nan, 0.01, round(fingerprint), pause)
