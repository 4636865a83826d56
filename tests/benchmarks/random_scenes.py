"""How many random scenes are solved, and what becomes of the others.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.random_scenes scenes [--count 1000] [--first 0] [--records FILE]
    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.random_scenes sector --mesh 1 --count 200
    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.random_scenes blocks --count 500

- `scenes`: the first periodic state without wear, and a history of a few steps of wear.
- `sector`: the bundled dovetail at nodal diameters 0 to 23, friction 0.1 to 0.8, 0.1 to 3 N, 0.98 to 1.02 times the
  first frequency of its stuck joint, 1e5 cycles. An end that is physics counts as solved: a doubled period, a root that
  drifts.
- `blocks`: static states of two or three elastic blocks. Solved: the solver agrees with a linear programme which says
  whether contact forces can balance the load at all.

Prints the cases that are not solved, all outcomes, and quantiles of run times, certificates and errors of contact laws.
"""

import traceback
from collections import Counter
from typing import Any

import numpy as np

from solver import march_wear as march_from_rest
from solver.outcome import COMPLETE, Outcome
from solver.settings import SolverSettings
from solver.wear.slow_time import CERTIFIED
from studies.scenes import AUTOMATIC_HARMONICS_OF_A_WAVE
from tests.benchmarks.frame import Table, arguments, measure
from tests.random_decks import EXPECTED, random_deck, run_deck
from tests.random_scenes import SALT, RandomScene, log_uniform, random_scene
from tests.solver.models import branch_states, glued_frequency, march_wear, scene

SETTINGS = SolverSettings(time_limit=60.0)  # CPU s of the first state, and of the history
N_OUTPUTS = 6
PHYSICS = {*COMPLETE, Outcome.PERIOD_DOUBLED, Outcome.ADRIFT}


def run_scene(scene: RandomScene, settings: SolverSettings = SETTINGS) -> dict[str, Any]:
    """What became of a scene: outcomes of the first state and of the history, certificate, harmonics and samples."""
    (start,) = branch_states(scene.model, scene.friction, scene.amplitude, [2.0 * np.pi * scene.frequency_hz], settings)
    record: dict[str, Any] = {"first": start.outcome.meaning, "march": ""}
    record |= {"harmonics": start.resolution.highest, "samples": start.resolution.samples}
    if start.state is None:
        return record
    asked = (scene.wear_coefficient, scene.step, scene.scheme, np.linspace(0.0, scene.cycles, N_OUTPUTS), settings)
    history = march_wear(scene.model, scene.friction, start, *asked)
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


def small_scene(seed: int, _: int) -> dict[str, Any]:
    drawn = random_scene(seed)
    record = run_scene(drawn)
    return {**record, "facts": drawn.facts, "solved": solved(record), "ended": f"{record['first']}, {record['march']}"}


def sector_point(seed: int, mesh: int) -> dict[str, Any]:
    random = np.random.default_rng([SALT, seed])
    diameter, friction = int(random.integers(0, 24)), float(random.uniform(0.1, 0.8))
    amplitude, ratio = log_uniform(random, 0.1, 3.0), float(random.uniform(0.98, 1.02))
    model = scene("dovetail_sector", AUTOMATIC_HARMONICS_OF_A_WAVE, mesh=mesh, nodal_diameter=diameter)
    frequency = ratio * glued_frequency(model)
    settings = SolverSettings(time_limit=120.0)
    history = march_from_rest(model, frequency, amplitude, friction, 1.1e-11, 1e5, settings=settings)
    worn = 1e9 * float(history.worn_volume[-1])
    return {
        "facts": f"d {diameter}, {frequency:.2f} Hz, {amplitude:.3f} N, mu {friction:.3f}",
        "solved": history.outcome in PHYSICS,
        "ended": f"{history.outcome.meaning}, {'wears' if worn > 0.0 else 'at rest'}",
        "worn volume, mm3": worn,
        "error": history.error_estimate,
    }


def blocks(seed: int, _: int) -> dict[str, Any]:
    deck = random_deck(seed)
    exists, outcome, errors = run_deck(deck)
    ended = f"static state {exists}, {outcome.meaning}"
    return {"facts": deck.facts, "solved": outcome in EXPECTED[exists], "ended": ended, **errors}


KINDS = {"scenes": small_scene, "sector": sector_point, "blocks": blocks}


def main() -> None:
    given = arguments(__doc__, tuple(KINDS), count=1000, first=0, mesh=1, records=None)
    for word in given.chosen:
        table, records = Table(f"{word} not solved", "seed", "CPU s", "ended", file=given.records), []
        for seed in range(given.first, given.first + given.count):
            try:
                found = measure(lambda word=word, seed=seed: KINDS[word](seed, given.mesh))
                record = {**found.result, "seconds": found.seconds, "iterations": found.iterations}
            except Exception as error:
                traceback.print_exc(limit=-3)
                record = {"facts": "", "solved": False, "ended": repr(error), "seconds": 0.0}
            records.append(record)
            if not record["solved"]:
                table.row(record["facts"], seed, record["seconds"], record["ended"])
        print(f"{sum(record['solved'] for record in records)} of {given.count} solved")
        for ended, number in Counter(record["ended"] for record in records).most_common():
            print(f"{number:6d} {ended}")
        quantiles = Table("quantiles", "0.5", "0.9", "0.99", "1.0")
        for name in dict.fromkeys(name for record in records for name in record):
            values = [record[name] for record in records if isinstance(record.get(name), int | float)]
            known = np.array([value for value in values if not (isinstance(value, bool) or np.isnan(value))])
            if known.size:
                # of those with a value; one of the values, as half way to an error that is not known, inf, is no number
                quantiles.row(name, *np.quantile(known, (0.5, 0.9, 0.99, 1.0), method="higher").tolist())


if __name__ == "__main__":
    main()
