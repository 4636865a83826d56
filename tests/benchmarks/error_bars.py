"""Estimated over true errors of worn volumes: bundled dovetail and random small joints, all schemes and steps.

    python -m tests.benchmarks.error_bars --mesh 1 2 --random 200
    python -m tests.benchmarks.error_bars --mesh 1 --diameter 3 7 --frequency -0.25 0.25
    OPENBLAS_CORETYPE=Nehalem python -m tests.benchmarks.error_bars --mesh 2 --frequency 212 --stuck-modes 30

The truth of a dovetail is the adaptive scheme with a tolerance ten times smaller and harmonics given, from the start
state of a sweep in steps five times as fine; that of a random joint the same with 13 harmonics for its five: what the
harmonics of its start state are wrong by is an error, too. What is wanted: at least half the true error everywhere, in
the median not more than ten times it. Where both are below `FLOOR` of the volume nothing is compared: the truth is not
known better. The responses are compared on the way, too, and at the end the depths of all pairs that have a tenth of
the deepest. Frequencies of a travelling wave (`--diameter`) are offsets from the resonance of the glued structure, Hz.
`--stuck-modes` reduces the structure in another way. `--fixed` takes fixed harmonics instead of automatic ones, and the
adaptive scheme alone: with three of them a pair of the dovetail at 211.5 Hz locks that slips with five and more.

At 212.5 Hz the truth is one of three. Two pairs of mesh 2 come to rest at 15 000 cycles, or go on by a hair: 0.082 mm3,
0.094 where one goes on, 0.106 where both do. A sweep with 13 harmonics in steps of 0.02 gives 0.0819; nine harmonics
0.0820, 0.0807, 0.0944, 0.0826 in steps of 0.1, 0.05, 0.02, 0.01; five harmonics 0.1060 and 0.0936 in steps of 0.1
and 0.02. The same holds for 0.155 and 0.163 mm3 at 212.25 Hz.
"""

import argparse
import time
from dataclasses import dataclass
from itertools import product

import numpy as np

from solver.loading_history import path
from solver.loading_history.start_states import follow_branch
from solver.model import FloatArray, ReducedModel
from solver.results.history import StartState, WearHistory
from solver.settings import Scheme, SolverSettings
from tests.solver.models import branch_states, glued_frequency, march_wear, random_model, scene

WEAR = 1.1e-11  # 1/Pa
STEPS = (250.0, 500.0, 1000.0, 2000.0)
FREQUENCIES = {
    1: (212.5, 212.75, 213.0, 213.25),
    2: (211.0, 211.25, 211.375, 211.5, 211.75, 212.0, 212.25, 212.5),
    3: (211.0,),
}
OFFSETS = (-0.25, 0.25)  # Hz, from the resonance of the glued structure, of travelling waves
HARMONICS = 21  # whose nodal diameters the scene holds
FLOOR = 2e-3
KINDS = (("3d", "3d"), ("3d", "one_tangent"), ("one_tangent", "one_tangent", "3d"))


@dataclass(frozen=True)
class Compared:
    """One history.

    estimated, true: relative error of the worn volume at the end.
    smallest, response: smallest ratio of estimated and true error on the way, of worn volume and responses.
    outside, pairs: number of deep pairs whose true error at the end is beyond its estimate, of how many.
    worst: smallest ratio of estimated and true error of these pairs.
    """

    name: str
    estimated: float
    true: float
    smallest: float
    response: float
    outside: int
    pairs: int
    worst: float
    seconds: float

    def line(self) -> str:
        """A row of the table."""
        ratio = self.estimated / self.true if self.true > 0.0 else float("nan")
        return (
            f"{self.name:<44} {self.estimated:9.2e} {self.true:9.2e} {ratio:7.2f} {self.smallest:7.2f} "
            f"{self.response:7.2f} {self.outside:4d} of {self.pairs:2d} {self.worst:6.2f} {self.seconds:6.1f} s"
        )


def compare(name: str, history: WearHistory, truth: WearHistory, seconds: float) -> Compared:
    """Errors of a history against the true one at the same counts."""
    true = np.abs(history.worn_volume - truth.worn_volume)
    estimated = history.worn_volume_error * history.worn_volume
    # only where something has worn and the truth is known
    last = np.nanmax(truth.worn_volume)
    worn = (truth.worn_volume > 1e-3 * last) & np.isfinite(true)
    moved = np.linalg.norm(history.response - truth.response, axis=1) / np.linalg.norm(truth.response, axis=1)
    volume, depth = history.worn_volume[-1], truth.wear_depth[-1]
    deep = (depth > 0.1 * depth.max()) & np.isfinite(history.wear_depth[-1])
    off = np.abs(history.wear_depth[-1] - depth)[deep]
    off = np.where(off > FLOOR * depth[deep], off, 0.0)
    return Compared(
        name,
        history.error_estimate,
        float(true[-1] / volume) if volume > 0.0 else 0.0,
        smallest_ratio(estimated, true, worn & (true > FLOOR * truth.worn_volume)),
        smallest_ratio(history.response_error, moved, worn & (moved > FLOOR)),
        int((off > history.wear_depth_error[-1][deep]).sum()),
        int(deep.sum()),
        smallest_ratio(history.wear_depth_error[-1][deep], off, off > 0.0),
        seconds,
    )


def smallest_ratio(estimated: FloatArray, true: FloatArray, seen: np.ndarray) -> float:
    """Smallest ratio of estimated and true errors where they are seen, inf where none are; all (n,)."""
    return float((estimated[seen] / true[seen]).min(initial=np.inf))


def dovetail_starts(
    model: ReducedModel, frequencies: tuple[float, ...], settings: SolverSettings, change: float | None = None
) -> list[StartState]:
    """Start states. change: of the vibration in a step of the sweep; None for the one that follows rtol."""
    before = path.CHANGE_LIMITS
    if change is not None:
        path.CHANGE_LIMITS = (change, change)
    try:
        found = dict(follow_branch(model, 0.5, 0.5, np.array(frequencies), "up", settings))
    finally:
        path.CHANGE_LIMITS = before
    return [found[place] for place in range(len(frequencies))]


def dovetail(
    title: str, model: ReducedModel, steps: tuple[float, ...], frequencies: tuple[float, ...], fixed: tuple[int, ...]
) -> list[Compared]:
    """All schemes and steps at some frequencies, Hz; fixed: harmonics, adaptive scheme alone."""
    cycles = np.linspace(0.0, 1e5, 101)
    runs: list[tuple[Scheme, float]] = [("adaptive", 1e-2)]
    if not fixed:
        runs += [(scheme, step) for scheme in ("implicit", "explicit") for step in steps]
    compared = []
    exact = SolverSettings(harmonics=9, samples=128, rtol=1e-3)
    fine = dovetail_starts(model, frequencies, exact, 0.03)
    truths = [march_wear(model, 0.5, start, WEAR, 1000.0, "adaptive", cycles, exact) for start in fine]
    for frequency, truth in zip(frequencies, truths, strict=True):
        print(
            f"{title}, {frequency:.7g} Hz: {1e9 * truth.worn_volume[-1]:.5f} mm3, by itself known to "
            f"{truth.error_estimate:.1e}, {truth.outcome.meaning}",
            flush=True,
        )
    for settings in [SolverSettings(harmonics=harmonics) for harmonics in fixed] or [SolverSettings()]:
        starts = dovetail_starts(model, frequencies, settings)
        for frequency, truth, start in zip(frequencies, truths, starts, strict=True):
            for scheme, step in runs:
                begun = time.thread_time()
                history = march_wear(model, 0.5, start, WEAR, step, scheme, cycles, settings)
                name = (
                    f"{title}, H {settings.harmonics}, {frequency:.7g} Hz, {scheme} {step:g} {history.outcome.meaning}"
                )
                compared.append(compare(name, history, truth, time.thread_time() - begun))
                print(compared[-1].line(), flush=True)
    return compared


def random_joints(n: int) -> list[Compared]:
    """Small joints of random structures, steps from a twentieth of the explicit limit to half of it."""
    compared = []
    settings = SolverSettings(harmonics=5, samples=64)
    exact = SolverSettings(harmonics=13, samples=256, rtol=3e-4)
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
            begun = time.thread_time()
            history = march_wear(model, 0.4, start, WEAR, step, scheme, cycles, settings)
            name = f"joint {seed}, {scheme} {step / limit:.2g} of the limit"
            compared.append(compare(name, history, truth, time.thread_time() - begun))
    return compared


def summarise(title: str, compared: list[Compared]) -> None:
    """The worst of all, and the median."""
    known = [one for one in compared if np.isfinite(one.smallest)]
    ratios = [one.estimated / one.true for one in known if one.true > FLOOR]
    if not known:
        return
    worst = min(known, key=lambda one: one.smallest)
    n_low = sum(one.smallest < 0.5 for one in known)
    moved, outside = min(one.response for one in compared), sum(one.outside for one in compared)
    print(
        f"{title}: {len(known)} histories, ratio at the end in the median {np.median(ratios):.2f}, at least "
        f"{min(ratios):.2f}; on the way at least {worst.smallest:.2f}; {n_low} below 0.5; "
        f"responses at least {moved:.2f}, {sum(one.response < 0.5 for one in compared)} below 0.5; {outside} of "
        f"{sum(one.pairs for one in compared)} depths outside, at least {min(one.worst for one in compared):.2f}"
    )
    for one in sorted(known, key=lambda one: one.smallest)[:5]:
        print("   ", one.line())


def main() -> None:
    """Everything that is asked for."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--mesh", type=int, nargs="*", default=[1])
    parser.add_argument("--diameter", type=int, nargs="*", default=[0], help="0: blades alike; above: travelling wave")
    parser.add_argument("--stuck-modes", type=int, default=20, help="modes of the glued sector in the reduced model")
    parser.add_argument("--random", type=int, default=0)
    parser.add_argument("--step", type=float, nargs="*", default=list(STEPS))
    parser.add_argument("--fixed", type=int, nargs="*", default=[], help="harmonics, in place of automatic ones")
    parser.add_argument("--frequency", type=float, nargs="*", default=[], help="Hz, those of the mesh by default")
    given = parser.parse_args()
    print(f"{'history':<44} estimated      true   ratio  on the way: volume, response; pairs outside, worst")
    for mesh, diameter in product(given.mesh, given.diameter):
        model = scene("dovetail_sector", HARMONICS, mesh=mesh, nodal_diameter=diameter, stuck_modes=given.stuck_modes)
        frequencies = np.array(given.frequency or (OFFSETS if diameter else FREQUENCIES[mesh]))
        if diameter:
            frequencies += glued_frequency(model)
        title = f"mesh {mesh}, d {diameter}"
        summarise(title, dovetail(title, model, tuple(given.step), tuple(frequencies.tolist()), tuple(given.fixed)))
    if given.random:
        summarise("random joints", random_joints(given.random))


if __name__ == "__main__":
    main()
