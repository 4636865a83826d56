"""Records of histories with given numbers, for what is collected from them at the end of a run."""

from collections.abc import Callable
from typing import Any

import numpy as np

from studyrunner.checkpoint.records import record_of, record_type
from studyrunner.plan.planning import build_tasks
from studyrunner.plan.results import MarchResult
from studyrunner.plan.sharing import Index
from studyrunner.scene.scene import SceneFacts
from studyrunner.study.study import Study
from tests.studyrunner.fakes import FACTS, changed, fake_histories


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


def told(
    ask: Callable[[Any], Any],
    make: Callable[[], Any],
    study: Study,
    results: list[MarchResult],
    facts: SceneFacts = FACTS,
) -> Any:
    """What a collector says of results that come three at a time, whatever their order. make: a new collector."""
    kind, said = record_type(study, facts), []
    for given in (results, results[::-1]):
        collector = make()
        for first in range(0, len(given), 3):
            some = given[first : first + 3]
            collector.add([result.points for result in some], np.concatenate([record_of(kind, one) for one in some]))
        said.append(ask(collector))
    assert said[0] == said[1]
    return said[0]
