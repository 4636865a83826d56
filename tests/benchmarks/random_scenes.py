"""How many random scenes are solved, and what becomes of the others.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.random_scenes [--count 1000] [--first 0] [--records FILE]

Each scene: the first periodic state without wear, its certificate, a march of a few steps of wear. Prints outcomes,
the largest numbers of the certificates, the seeds of those that fail with what they are, and the run time. `--records`
keeps one JSON line a scene.
"""

import argparse
import json
import signal
import time
import traceback
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

from solver.loading_history.start_states import follow_branch
from solver.outcome import Outcome
from solver.settings import SolverSettings
from solver.wear.course import CERTIFIED
from tests.random_scenes import RandomScene, random_scene
from tests.solver.models import march_wear

SETTINGS = SolverSettings()
BOUND = 60  # s of CPU time: a scene that takes longer hangs
N_OUTPUTS = 6
COMPLETE = {outcome.meaning for outcome in Outcome if outcome.complete}


class BoundExceededError(BaseException):
    """The scene took longer than BOUND. No error that a part of the solver takes for a failure of its own."""


def run_scene(scene: RandomScene, settings: SolverSettings = SETTINGS) -> dict[str, Any]:
    """What became of a scene: outcomes of the first state and of the march, certificate, iterations, time in s."""
    started = time.perf_counter()
    record: dict[str, Any] = {"seed": scene.seed, "facts": scene.facts, "scheme": scene.scheme, "march": ""}
    frequencies = np.array([scene.frequency_hz])
    _, start = next(follow_branch(scene.model, scene.friction, scene.amplitude, frequencies, "up", settings))
    record |= {"first": start.outcome.meaning, "iterations": start.newton_iterations}
    record |= {"harmonics": start.resolution.highest, "samples": start.resolution.samples}
    record |= {"response_error": start.response_error, "wear_rate_error": start.wear_rate_error}
    record |= {"branch": start.branch, "time": time.perf_counter() - started}
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
        for name in CERTIFIED:
            record[name] = float(np.nanmax(getattr(history, name), initial=0.0))
    record |= {"jumped": bool(np.isfinite(history.jump_cycle)), "march_iterations": history.newton_iterations}
    record["march_time"] = time.perf_counter() - started - record["time"]
    return record


def bounded(seed: int) -> dict[str, Any]:
    """Record of a scene, whatever happens."""

    def stop(*_: object) -> None:
        raise BoundExceededError

    scene = random_scene(seed)
    signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, BOUND)
    try:
        record = run_scene(scene)
    except BoundExceededError:
        where = traceback.format_exc(limit=-6)
        record = {"seed": seed, "facts": scene.facts, "first": "hangs", "march": "", "time": BOUND, "where": where}
    except Exception as error:
        where = traceback.format_exc(limit=-3)
        record = {"seed": seed, "facts": scene.facts, "first": repr(error), "march": "", "time": 0.0, "where": where}
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
    return record


def solved(record: dict[str, Any]) -> bool:
    """Whether the first state has converged and the march was computed to its end, with its error."""
    return record["first"] == "converged" and record["march"] in COMPLETE


def main() -> None:
    """Runs the scenes and prints the tables."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--count", type=int, default=1000)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--records", type=Path)
    given = parser.parse_args()
    started = time.perf_counter()
    records = []
    for seed in range(given.first, given.first + given.count):
        records.append(bounded(seed))
        if given.records is not None:
            with given.records.open("a") as file:
                file.write(json.dumps(records[-1]) + "\n")
    print(f"{given.count} scenes in {time.perf_counter() - started:.0f} s; {sum(map(solved, records))} solved")
    print("first state:", dict(Counter(record["first"] for record in records)))
    print("march:", dict(Counter(record["march"] for record in records if record["march"])))
    for name in ("time", "march_time", "iterations", "harmonics", "samples", *CERTIFIED):
        known = [record for record in records if name in record]
        values = np.array([record[name] for record in known])
        quantiles = ", ".join(f"{share}: {np.quantile(values, share):.1e}" for share in (0.5, 0.9, 0.99, 1.0))
        print(f"{name}: quantiles {quantiles}; largest at seed {known[int(np.argmax(values))]['seed']}")
    for record in records:
        if not solved(record):
            print(record["seed"], record["first"], record["march"], "|", record["facts"])


if __name__ == "__main__":
    main()
