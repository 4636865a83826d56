"""How many random scenes are solved, and what becomes of the others.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.random_scenes [--count 1000] [--first 0] [--records FILE]

Each scene: the first periodic state without wear, its certificate, a history of a few steps of wear. Prints all scenes
that are not solved, outcomes, and quantiles of run times and of the certificates.
"""

import traceback
from collections import Counter
from typing import Any

import numpy as np

from solver.outcome import COMPLETE, Outcome
from solver.settings import SolverSettings
from solver.wear.course import CERTIFIED
from tests.benchmarks.frame import Table, arguments, measure
from tests.random_scenes import RandomScene, random_scene
from tests.solver.models import branch_states, march_wear

SETTINGS = SolverSettings(time_limit=60.0)  # CPU s of the first state, and of the history
N_OUTPUTS = 6
NUMBERS = ("seconds", "iterations", "harmonics", "samples", *CERTIFIED)


def run_scene(scene: RandomScene, settings: SolverSettings = SETTINGS) -> dict[str, Any]:
    """What became of a scene: outcomes of the first state and of the history, certificate, harmonics and samples."""
    (start,) = branch_states(scene.model, scene.friction, scene.amplitude, [2.0 * np.pi * scene.frequency_hz], settings)
    record: dict[str, Any] = {"first": start.outcome.meaning, "march": ""}
    record |= {"harmonics": start.resolution.highest, "samples": start.resolution.samples}
    if start.state is None:
        return record
    cycles = np.linspace(0.0, scene.cycles, N_OUTPUTS)
    history = march_wear(
        scene.model, scene.friction, start, scene.wear_coefficient, scene.step, scene.scheme, cycles, settings
    )
    record["march"] = history.outcome.meaning
    if history.outcome.complete:
        values = [history.wear_depth, history.wear_rate, history.response, history.mean_pressure]
        if not all(np.isfinite(value).all() for value in values):
            record["march"] = "NaN where converged"
        elif (np.diff(history.wear_depth, axis=0) < 0.0).any():
            record["march"] = "wear falls"
        record["slips"] = bool(history.slip_range[0].max() > 0.0)
        record["opens"] = bool((history.open_fraction[0] > 0.0).any())
        record |= {name: float(np.nanmax(getattr(history, name), initial=0.0)) for name in CERTIFIED}
    return record


def solved(record: dict[str, Any]) -> bool:
    """Whether the first state has converged and the history was computed to its end, with its error."""
    return record["first"] == Outcome.CONVERGED.meaning and record["march"] in {each.meaning for each in COMPLETE}


def main() -> None:
    """Runs the scenes and prints the tables."""
    given = arguments(__doc__, count=1000, first=0, records=None)
    table = Table("not solved", "seed", "first", "history", "CPU s", file=given.records)
    records = []
    for seed in range(given.first, given.first + given.count):
        scene = random_scene(seed)
        try:
            found = measure(lambda scene=scene: run_scene(scene))
            records.append({**found.result, "seconds": found.seconds, "iterations": found.iterations})
        except Exception as error:
            traceback.print_exc(limit=-3)
            records.append({"first": repr(error), "march": "", "seconds": 0.0})
        if not solved(record := records[-1]):
            table.row(scene.facts, seed, record["first"], record["march"], record["seconds"])
    print(f"{sum(map(solved, records))} of {given.count} scenes solved")
    for name in ("first", "march"):
        print(f"{name}:", dict(Counter(record[name] for record in records)))
    quantiles = Table("quantiles", "0.5", "0.9", "0.99", "1.0")
    for name in NUMBERS:
        values = np.array([record[name] for record in records if name in record])
        quantiles.row(name, *np.quantile(values, (0.5, 0.9, 0.99, 1.0)).tolist())


if __name__ == "__main__":
    main()
