"""Estimated over true errors of worn volumes: bundled dovetail and random small joints, all schemes and steps.

    python -m tests.benchmarks.error_bars --mesh 1 2 --random 200
    python -m tests.benchmarks.error_bars --mesh 1 --diameter 3 7 --frequency -0.25 0.25
    python -m tests.benchmarks.error_bars --mesh --loads 60 [--rtol 1e-1 1e-2 1e-3]

The truth of a dovetail is the adaptive scheme with a tolerance of 1e-3 or a tenth, from the start state of a sweep in
steps five times as fine; that of a random joint the same with 13 harmonics for its five. Random loads are adaptive
histories of mesh 1 near its resonance, 5e4 to 6e5 cycles. Truths have automatic harmonics: with 13 and 256 samples that
of load 46 is 4 % off. Wanted: at least half the true error everywhere, in the median not more than ten times it.
Differences below the error of the truth, or below `FLOOR` of the volume, do not count: the truth is not known better.

Columns: relative errors of the worn volume at the end, and their ratio; the smallest ratio of volumes and of responses
on the way; that of the depths of all pairs that have a tenth of the deepest; how many of these depths are outside of
their errors. Frequencies of a travelling wave (`--diameter`) are offsets from the resonance of the glued structure, Hz.

At 212.5 Hz two pairs of mesh 2 come to rest at 15 000 cycles, or go on by a hair, by the harmonics of the sweep: 0.071
mm3 with 9 to 27 given harmonics and 256 samples or more, 0.094 with nodes of 5 harmonics.
"""

from itertools import product

import numpy as np

from solver.loading_history import path
from solver.model import FloatArray, ReducedModel
from solver.results.history import StartState, WearHistory
from solver.settings import Scheme, SolverSettings
from tests.benchmarks.frame import Table, arguments, measure
from tests.solver.models import branch_states, glued_frequency, march_wear, random_model, scene

WEAR = 1.1e-11  # 1/Pa
STEPS = [250.0, 500.0, 1000.0, 2000.0]
FREQUENCIES = {1: (212.5, 212.75, 213.0, 213.25), 2: (211.0, 211.25, 211.375, 211.5, 211.75, 212.0, 212.25, 212.5)}
OFFSETS = (-0.25, 0.25)  # Hz, from the resonance of the glued structure, of travelling waves
HARMONICS = 39  # whose nodal diameters the scene holds
FLOOR = 2e-3
KINDS = (("3d", "3d"), ("3d", "one_tangent"), ("one_tangent", "one_tangent", "3d"))
COLUMNS = ("estimated", "true", "ratio", "on the way", "responses", "depths", "outside", "of", "CPU s")


def smallest_ratio(estimated: FloatArray, true: FloatArray, seen: np.ndarray) -> float:
    """Smallest ratio of estimated and true errors where they are seen, inf where none are; all (n,)."""
    return float((estimated[seen] / true[seen]).min(initial=np.inf))


def compare(history: WearHistory, truth: WearHistory) -> list[float]:
    """The columns of the table, without the time, of a history against the true one at the same counts."""
    true = np.abs(history.worn_volume - truth.worn_volume)
    # only where something has worn and the truth is known, and there better than the difference
    worn = (truth.worn_volume > 1e-3 * np.nanmax(truth.worn_volume)) & np.isfinite(true)
    known = worn & (true > np.maximum(FLOOR, truth.worn_volume_error) * truth.worn_volume)
    moved = np.linalg.norm(history.response - truth.response, axis=1) / np.linalg.norm(truth.response, axis=1)
    volume, depth = history.worn_volume[-1], truth.wear_depth[-1]
    deep = (depth > 0.1 * depth.max()) & np.isfinite(history.wear_depth[-1])
    off, off_estimated = np.abs(history.wear_depth[-1] - depth)[deep], history.wear_depth_error[-1][deep]
    off = np.where(off > np.maximum(FLOOR * depth, truth.wear_depth_error[-1])[deep], off, 0.0)
    last = float(true[-1] / volume) if volume > 0.0 else 0.0
    volumes = history.worn_volume_error * history.worn_volume, true, known
    return [
        *(history.error_estimate, last, history.error_estimate / last if known[-1] else float("nan")),
        smallest_ratio(*volumes),
        smallest_ratio(history.response_error, moved, worn & (moved > np.maximum(FLOOR, truth.response_error))),
        smallest_ratio(off_estimated, off, off > 0.0),
        *(int((off > off_estimated).sum()), int(deep.sum())),
    ]


def add_row(
    table: Table, name: str, truth: WearHistory, model: ReducedModel, friction: float, start: StartState, *asked: object
) -> None:
    """A row for a history from a start state, without the time of this; asked: the arguments of `march_wear` from the
    wear coefficient on.
    """
    found = measure(lambda: march_wear(model, friction, start, *asked))
    table.row(f"{name} {found.result.outcome.meaning}", *compare(found.result, truth), found.seconds)


def summarise(table: Table, rtol: float = SolverSettings().rtol) -> None:
    """How many adaptive histories keep rtol, and their CPU time; median and worst ratios; how many are too small."""
    rows = [row for row in table.rows[1:] if np.isfinite(float(row[2]))]
    if rows:
        estimated, _, ratio, *least, outside, pairs, spent = np.array([row[1:] for row in rows], dtype=float).T
        adaptive = np.array([not {"implicit", "explicit"} & set(str(row[0]).split()) for row in rows])
        kept, of = estimated[adaptive] <= rtol, f"adaptive ones within rtol = {rtol:g}"
        print(f"{len(rows)} histories, {kept.sum()} of {kept.size} {of}, median {np.median(spent[adaptive]):.1f} CPU s")
        at_end = ratio[~np.isnan(ratio)]
        if at_end.size:
            print(f"at the end, {at_end.size} known: median {np.median(at_end):.2f}, least {at_end.min():.2f}")
        for name, column in zip(COLUMNS[3:6], least, strict=True):
            print(f"{name}: least {column.min():.2f}, {(column < 0.5).sum()} below 0.5")
        print(f"{outside.sum():.0f} of {pairs.sum():.0f} depths outside")


def fine_starts(
    model: ReducedModel, friction: float, load: float, omegas: list[float], settings: SolverSettings, sweep: str = "up"
) -> list[StartState]:
    """Start states of a sweep whose steps change the vibration by 3 %."""
    before, path.CHANGE_LIMITS = path.CHANGE_LIMITS, (0.03, 0.03)
    try:
        return branch_states(model, friction, load, omegas, settings, sweep)
    finally:
        path.CHANGE_LIMITS = before


def dovetail(title: str, model: ReducedModel, steps: list[float], frequencies: FloatArray) -> None:
    """All schemes and steps at some frequencies, Hz."""
    cycles, table, omegas = np.linspace(0.0, 1e5, 101), Table(title, *COLUMNS), list(2.0 * np.pi * frequencies)
    runs: list[tuple[Scheme, float]] = [("adaptive", 1e-2)]
    runs += [(scheme, step) for scheme in ("implicit", "explicit") for step in steps]
    exact, settings = SolverSettings(rtol=1e-3), SolverSettings()
    starts = branch_states(model, 0.5, 0.5, omegas, settings)
    for frequency, fine, start in zip(frequencies, fine_starts(model, 0.5, 0.5, omegas, exact), starts, strict=True):
        truth = march_wear(model, 0.5, fine, WEAR, 1000.0, "adaptive", cycles, exact)
        for scheme, step in runs:
            name = f"{frequency:.7g} Hz, {scheme} {step:g}"
            add_row(table, name, truth, model, 0.5, start, WEAR, step, scheme, cycles, settings)
    summarise(table)


def random_loads(n: int, rtol: float) -> None:
    """Adaptive histories of the coarse dovetail near its resonance under random loads; those that wear."""
    table, model = Table(f"random loads, rtol {rtol:g}", *COLUMNS), scene("dovetail_sector", HARMONICS, mesh=1)
    settings, exact = SolverSettings(rtol=rtol), SolverSettings(rtol=min(1e-3, 0.1 * rtol))
    first = glued_frequency(model)
    for seed in range(n):
        random = np.random.default_rng(1000 + seed)
        frequency = first * random.uniform(0.9955, 1.0008)
        load, friction = float(np.exp(random.uniform(*np.log([0.4, 1.3])))), random.uniform(0.3, 0.6)
        wear = float(np.exp(random.uniform(*np.log([2e-12, 5e-11]))))
        cycles = np.linspace(0.0, 10.0 ** random.uniform(4.7, 5.8), 41)
        asked = model, friction, load, [2.0 * np.pi * frequency]
        sweep = str(random.choice(["up", "down", "ramp"]))
        (start,), (fine,) = branch_states(*asked, settings, sweep), fine_starts(*asked, exact, sweep)
        if start.state is None or fine.state is None:
            continue
        truth = march_wear(model, friction, fine, wear, 1000.0, "adaptive", cycles, exact)
        if np.nanmax(truth.worn_volume) > 0.0:
            name = f"{seed}, {frequency:.7g} Hz, {load:.3g} N, {sweep}"
            add_row(table, name, truth, model, friction, start, wear, 1000.0, "adaptive", cycles, settings)
    summarise(table, rtol)


def random_joints(n: int) -> None:
    """Small joints of random structures, steps from a twentieth of the explicit limit to half of it."""
    table = Table("random joints", *COLUMNS)
    settings, exact = SolverSettings(harmonics=5, samples=64), SolverSettings(harmonics=13, samples=256, rtol=3e-4)
    for seed in range(n):
        random, model = np.random.default_rng(seed), random_model(seed, KINDS[seed % len(KINDS)])
        amplitude = float(random.uniform(40.0, 150.0))
        (start,), (fine,) = (branch_states(model, 0.4, amplitude, [600.0], given) for given in (settings, exact))
        if start.state is None or fine.state is None:
            continue
        limit = march_wear(model, 0.4, start, WEAR, 1.0, "implicit", np.array([0.0]), settings).step_limit
        if not np.isfinite(limit):
            continue
        step = float(limit * random.choice([0.05, 0.15, 0.5]))
        cycles = np.linspace(0.0, 24.0 * step, 13)
        truth = march_wear(model, 0.4, fine, WEAR, step, "adaptive", cycles, exact)
        for scheme in ("implicit", "explicit", "adaptive"):
            name = f"joint {seed}, {scheme} {step / limit:.2g} of the limit"
            add_row(table, name, truth, model, 0.4, start, WEAR, step, scheme, cycles, settings)
    summarise(table)


def main() -> None:
    given = arguments(__doc__, mesh=[1], diameter=[0], random=0, loads=0, rtol=[1e-2], step=STEPS, frequency=[0.0])
    for mesh, diameter in product(given.mesh, given.diameter):
        model = scene("dovetail_sector", HARMONICS, mesh=mesh, nodal_diameter=diameter)
        frequencies = np.array(given.frequency if any(given.frequency) else OFFSETS if diameter else FREQUENCIES[mesh])
        first = glued_frequency(model) if diameter else 0.0
        dovetail(f"mesh {mesh}, d {diameter}", model, given.step, first + frequencies)
    if given.random:
        random_joints(given.random)
    if given.loads:
        for rtol in given.rtol:
            random_loads(given.loads, rtol)


if __name__ == "__main__":
    main()
