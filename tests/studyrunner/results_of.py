"""Records of histories with given numbers, for what is collected from them at the end of a run."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from studyrunner.checkpoint.records import record_of, record_type
from studyrunner.plan.planning import build_tasks
from studyrunner.plan.results import MarchResult
from studyrunner.plan.sharing import Index
from studyrunner.scene.scene import SceneFacts
from studyrunner.study.study import Study
from tests.studyrunner.fakes import FACTS, changed, fake_histories

Batch = tuple[list[tuple[Index, ...]], NDArray[np.void]]


def results_of(study: Study, **given: Callable[[Index], object]) -> list[MarchResult]:
    """A result for each history of a study; those named are what the functions say of its first point."""
    plan = build_tasks(study, FACTS.n_displacements)
    results = []
    for _, result in fake_histories(plan):
        values = dict(result.values)
        # of states that are exact
        for name in ("response_error", "wear_rate_error"):
            values[name] = np.zeros(len(study.cycles_kept))
        values |= {name: say(min(result.points)) for name, say in given.items()}
        results.append(changed(result, **values))
    return results


def batches(study: Study, results: Sequence[MarchResult], size: int = 3, facts: SceneFacts = FACTS) -> list[Batch]:
    """Points and records of the results, some at a time."""
    kind = record_type(study, facts)
    found = []
    for first in range(0, len(results), size):
        some = results[first : first + size]
        found.append(([result.points for result in some], np.concatenate([record_of(kind, one) for one in some])))
    return found
