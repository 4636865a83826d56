"""Estimated over true errors of worn volumes: bundled dovetail and random small joints, all schemes and steps.

    python -m tests.benchmarks.error_bars --mesh 1 2 --random 200
    python -m tests.benchmarks.error_bars --mesh 1 --diameter 3 7 --frequency -0.25 0.25
    OPENBLAS_CORETYPE=Nehalem python -m tests.benchmarks.error_bars --mesh 2 --frequency 212 --stuck-modes 30

The truth of a dovetail is the adaptive scheme with a tolerance ten times smaller and harmonics given, from the start
state of a sweep in steps five times as fine; that of a random joint the same with 13 harmonics for its five. Wanted: at
least half the true error everywhere, in the median not more than ten times it. Where both are below `FLOOR` of the
volume nothing is compared: the truth is not known better. The responses are compared on the way, too, and at the end
the depths of all pairs that have a tenth of the deepest. Frequencies of a travelling wave (`--diameter`) are offsets
from the resonance of the glued structure, Hz. `--stuck-modes` reduces the structure in another way. `--fixed` takes
fixed harmonics instead of automatic ones, and the adaptive scheme alone.

At 212.5 Hz the truth is one of three. Two pairs of mesh 2 come to rest at 15 000 cycles, or go on by a hair: 0.082 mm3,
0.094 where one goes on, 0.106 where both do, by harmonics and steps of the sweep. The same holds for 0.155 and 0.163
mm3 at 212.25 Hz.
"""

from dataclasses import dataclass
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
FREQUENCIES = {
    1: (212.5, 212.75, 213.0, 213.25),
    2: (211.0, 211.25, 211.375, 211.5, 211.75, 212.0, 212.25, 212.5),
    3: (211.0,),
}
OFFSETS = (-0.25, 0.25)  # Hz, from the resonance of the glued structure, of travelling waves
HARMONICS = 21  # whose nodal diameters the scene holds
FLOOR = 2e-3
KINDS = (("3d", "3d"), ("3d", "one_tangent"), ("one_tangent", "one_tangent", "3d"))
COLUMNS = ("estimated", "true", "ratio", "on the way", "responses", "depths", "outside", "of", "CPU s")


@dataclass(frozen=True)
class Compared:
    """Errors of one history; the fields are the columns of the table.

    estimated, true: relative error of the worn volume at the end. on_the_way, responses, depths: smallest ratio of
    estimated and true error of worn volume and responses on the way, and of the depths of the deep pairs at the end.
    outside, pairs: number of these pairs whose true error is beyond its estimate, of how many.
    """

    estimated: float
    true: float
    ratio: float
    on_the_way: float
    responses: float
    depths: float
    outside: int
    pairs: int
    seconds: float


def compare(history: WearHistory, truth: WearHistory, seconds: float) -> Compared:
    """Errors of a history against the true one at the same counts."""
    true = np.abs(history.worn_volume - truth.worn_volume)
    estimated = history.worn_volume_error * history.worn_volume
    # only where something has worn and the truth is known
    worn = (truth.worn_volume > 1e-3 * np.nanmax(truth.worn_volume)) & np.isfinite(true)
    moved = np.linalg.norm(history.response - truth.response, axis=1) / np.linalg.norm(truth.response, axis=1)
    volume, depth = history.worn_volume[-1], truth.wear_depth[-1]
    deep = (depth > 0.1 * depth.max()) & np.isfinite(history.wear_depth[-1])
    off, off_estimated = np.abs(history.wear_depth[-1] - depth)[deep], history.wear_depth_error[-1][deep]
    off = np.where(off > FLOOR * depth[deep], off, 0.0)
    last = float(true[-1] / volume) if volume > 0.0 else 0.0
    return Compared(
        history.error_estimate,
        last,
        history.error_estimate / last if last > 0.0 else float("nan"),
        smallest_ratio(estimated, true, worn & (true > FLOOR * truth.worn_volume)),
        smallest_ratio(history.response_error, moved, worn & (moved > FLOOR)),
        smallest_ratio(off_estimated, off, off > 0.0),
        int((off > off_estimated).sum()),
        int(deep.sum()),
        seconds,
    )


def smallest_ratio(estimated: FloatArray, true: FloatArray, seen: np.ndarray) -> float:
    """Smallest ratio of estimated and true errors where they are seen, inf where none are; all (n,)."""
    return float((estimated[seen] / true[seen]).min(initial=np.inf))


def dovetail_starts(model: ReducedModel, frequencies: FloatArray, settings: SolverSettings) -> list[StartState]:
    """Start states of a sweep whose steps follow rtol."""
    return branch_states(model, 0.5, 0.5, list(2.0 * np.pi * frequencies), settings)


def fine_starts(model: ReducedModel, frequencies: FloatArray, settings: SolverSettings) -> list[StartState]:
    """The same with steps of the sweep in which the vibration changes by 3 %."""
    before, path.CHANGE_LIMITS = path.CHANGE_LIMITS, (0.03, 0.03)
    try:
        return dovetail_starts(model, frequencies, settings)
    finally:
        path.CHANGE_LIMITS = before


class Comparison:
    """Histories compared with their truth, in a table, and the worst of all."""

    def __init__(self, title: str) -> None:
        self.title, self.table, self.compared = title, Table(title, *COLUMNS), list[Compared]()

    def add(
        self, name: str, truth: WearHistory, model: ReducedModel, friction: float, start: StartState, *asked: object
    ) -> None:
        """A row for a history from a start state; asked: the arguments of `march_wear` from the step on."""
        found = measure(lambda: march_wear(model, friction, start, WEAR, *asked))
        self.compared.append(compare(found.result, truth, found.seconds))
        self.table.row(f"{name} {found.result.outcome.meaning}", *vars(self.compared[-1]).values())

    def summarise(self) -> None:
        """Median and worst ratios, and how many are too small."""
        known = [one for one in self.compared if np.isfinite(one.on_the_way)]
        ratios = [one.ratio for one in known if one.true > FLOOR]
        if known:
            low = {name: sum(getattr(one, name) < 0.5 for one in known) for name in ("on_the_way", "responses")}
            least = {name: min(getattr(one, name) for one in known) for name in ("on_the_way", "responses", "depths")}
            print(
                f"{self.title}: {len(known)} histories, ratio at the end in the median {np.median(ratios):.2f}, at"
                f" least {min(ratios):.2f}; smallest {least}, below 0.5 {low};"
                f" {sum(one.outside for one in known)} of {sum(one.pairs for one in known)} depths outside"
            )


def dovetail(title: str, model: ReducedModel, steps: list[float], frequencies: FloatArray, fixed: list[int]) -> None:
    """All schemes and steps at some frequencies, Hz; fixed: harmonics, adaptive scheme alone."""
    cycles, comparison = np.linspace(0.0, 1e5, 101), Comparison(title)
    runs: list[tuple[Scheme, float]] = [("adaptive", 1e-2)]
    if not fixed:
        runs += [(scheme, step) for scheme in ("implicit", "explicit") for step in steps]
    exact = SolverSettings(harmonics=9, samples=128, rtol=1e-3)
    fine = fine_starts(model, frequencies, exact)
    truths = [march_wear(model, 0.5, start, WEAR, 1000.0, "adaptive", cycles, exact) for start in fine]
    for settings in [SolverSettings(harmonics=harmonics) for harmonics in fixed] or [SolverSettings()]:
        for frequency, truth, start in zip(
            frequencies, truths, dovetail_starts(model, frequencies, settings), strict=True
        ):
            for scheme, step in runs:
                name = f"H {settings.harmonics}, {frequency:.7g} Hz, {scheme} {step:g}"
                comparison.add(name, truth, model, 0.5, start, step, scheme, cycles, settings)
    comparison.summarise()


def random_joints(n: int) -> None:
    """Small joints of random structures, steps from a twentieth of the explicit limit to half of it."""
    comparison = Comparison("random joints")
    settings, exact = SolverSettings(harmonics=5, samples=64), SolverSettings(harmonics=13, samples=256, rtol=3e-4)
    for seed in range(n):
        random = np.random.default_rng(seed)
        model = random_model(seed, KINDS[seed % len(KINDS)])
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
            comparison.add(name, truth, model, 0.4, start, step, scheme, cycles, settings)
    comparison.summarise()


def main() -> None:
    """Everything that is asked for."""
    given = arguments(__doc__, mesh=[1], diameter=[0], stuck_modes=20, random=0, step=STEPS, fixed=[0], frequency=[0.0])
    for mesh, diameter in product(given.mesh, given.diameter):
        model = scene("dovetail_sector", HARMONICS, mesh=mesh, nodal_diameter=diameter, stuck_modes=given.stuck_modes)
        frequencies = np.array(given.frequency if any(given.frequency) else OFFSETS if diameter else FREQUENCIES[mesh])
        if diameter:
            frequencies += glued_frequency(model)
        fixed = [harmonics for harmonics in given.fixed if harmonics]
        dovetail(f"mesh {mesh}, d {diameter}", model, given.step, frequencies, fixed)
    if given.random:
        random_joints(given.random)


if __name__ == "__main__":
    main()
