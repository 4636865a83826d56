"""Values of all kinds that the solver computes, against those that it computed before: equal, or explained.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.values --compare tests/benchmarks/values.csv [--only GROUP ...]
    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.values --write FILE.csv [--only GROUP ...]

Compared are outcomes, and values with their estimated errors, all relative. A value is "equal" to the bit, differs by
"round-off", "within" each of its errors before and now, by what both allow "together", or is "OUTSIDE", as any other is
whose error is not known. "GONE" is what there is no longer, "OUTCOME" another outcome: all in capitals gives status 1.
"""

import csv
import math
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

import solver
from solver import Block, Passage, ReducedModel, SolverSettings, build_model, frequency_response, march_wear
from solver.contact.wear_law import WearLaw, WearTable
from solver.settings import WearTarget
from studies import build_scene
from tests.benchmarks.frame import Table, arguments, measure
from tests.cantilever import Cantilever
from tests.rings import one_sector

ROUND_OFF = 1e-9
SOLVED = 1e-7
"""The smallest error of a value: states are solved to a residual of 1e-8, which no estimate holds. Measured with 1e-10:
the root at 212.42 Hz differs by 3e-8, other states by less than 1e-8."""
FOLD = 1e-3
"""Error of the frequency or load of a fold, which the solver does not estimate."""

Values = Iterator[tuple[str, complex, float]]
"""Name, value and error. A value of NaN is none."""


def of_sweep(found: solver.FrequencyResponse) -> Values:
    for row, at in enumerate(found.frequency):
        for name in ("response", "response_peak"):
            yield f"{name} {at:.6g} Hz", getattr(found, name)[row, 0], found.response_error[row]
        yield f"fold {at:.6g} Hz", found.fold_frequency[row], FOLD


def of_worn(found: Any) -> Values:
    """The last state of a history that was reached, and what has worn; of a start state its wear rate."""
    of_missions = isinstance(found, solver.MissionHistory)
    target = "missions_to_target" if of_missions else "cycles_to_target"
    yield target, getattr(found, target), getattr(found, f"{target}_error") / getattr(found, target)
    for row in np.flatnonzero(np.isfinite(found.worn_volume))[-1:]:
        depth, error = found.wear_depth[row], found.wear_depth_error[row]
        yield "volume", found.worn_volume[row] if row else math.nan, found.worn_volume_error[row]
        yield "deepest", depth.max() if row else math.nan, error[depth.argmax()] / depth.max()
        if of_missions:
            yield "last block", found.block_volume[row, -1], found.block_volume_error[row, -1]
            yield "last response", found.response_end[row, -1, 0], found.response_error[row, -1]
            continue
        yield "response", found.response[row, 0], found.response_error[row]
        followed, error = found.excitation_frequency[row], found.excitation_frequency_error[row]
        yield "frequency", followed if error else math.nan, error / followed
        begun, rate_error, off = math.nan if row else 1.0, found.wear_rate_error[row], found.energy_error[row]
        yield "wear rate", begun * found.wear_rate[row], rate_error
        yield "energy error", begun * off, rate_error / off


def of_mode(found: solver.Backbone) -> Values:
    for row, at in enumerate(found.amplitude):
        yield f"frequency {at:g}", found.frequency[row], found.frequency_error[row] / found.frequency[row]
        yield f"damping {at:g}", found.damping_ratio[row], abs(found.damping_error[row] / found.damping_ratio[row])


def of_curve(found: solver.ResponseCurve) -> Values:
    for number, at in enumerate(getattr(found, found.parameter)[found.is_fold]):
        yield f"fold {number}", at, FOLD
    for row in range(len(found.response))[-1:]:
        yield "response", found.response[row, 0], found.response_error[row]
        first, _, third = found.balance(row).motion().response[0, 1:4]
        yield "third harmonic", third or math.nan, found.response_error[row] * abs(first / third)
        yield "multiplier", abs(found.multipliers[row][0]), found.multiplier_error[row] / abs(found.multipliers[row][0])


# --- models and cases ---


def block(
    *pairs: Sequence[int], ground=(1e5, 1e5, 1e5), static=(100.0, 0.0, 0.0), lift: float = 0.0, ratio: float = 2.0
) -> ReducedModel:
    """A rigid block of 1 kg on elastic pairs without mass, which vibrates along both tangents.

    pairs: components of each: closing, first and second tangent; two with all of them if not given. ground: N/m, all
    that holds the block but friction. static: N. lift: vibrating force along the normal over that along a tangent.
    ratio: stiffness of the second pair over that of the first; each further one has as much more as the second.
    """
    pairs = pairs or ((0, 1, 2), (0, 1, 2))
    places, components = np.array([(place, component) for place, pair in enumerate(pairs) for component in pair]).T
    n, dofs = 3 + components.size, np.full((len(pairs), 3), -1)
    dofs[places, components] = np.arange(3, n)
    ties, springs = (
        np.eye(n)[components] - np.eye(n)[3:],
        1e7 * (1 + places * (ratio - 1)) * np.where(components > 0, 0.5, 1.0),
    )
    stiffness, none = ties.T @ np.diag(springs) @ ties + np.diag([*ground, *np.zeros(n - 3)]), np.zeros(n - 3)
    loads = {"load_static": [*static, *none], "load_harmonic": [lift, 1.0, 0.5j, *none], "response": [1, 2]}
    mass, pressed = np.diag([1.0, 1.0, 1.0, *none]), np.where(dofs[:, 0] < 0, 0.5 * static[0], 0.0)
    return build_model(mass, 9e-6 * stiffness, stiffness, dofs, 1e-4, normal_load=pressed, **loads)


def missions(model: ReducedModel, blocks: Sequence[tuple[Any, ...]], *given: Any, **named: Any) -> Any:
    """Blocks: frequency, N, and for a steady one cycles and how it begins; friction 0.5."""
    return solver.integrate_mission([Block(model, at, load, 0.5, *more) for at, load, *more in blocks], *given, **named)


def case(function: Callable[..., Any], read: Callable[[Any], Values], model: Callable[[], Any], *given, **named) -> Any:
    """Function, of a model and arguments; what takes the values from its result."""
    return lambda structure: function(structure, *given, **named), read, model


OFF = [0.02, -0.013, 0.0, 0.007, -0.018, 0.011]
swept, worn = partial(case, frequency_response, of_sweep), partial(case, march_wear, of_worn)
flown, mode = partial(case, missions, of_worn), partial(case, solver.backbone, of_mode)
curve = partial(case, solver.response_curve, of_curve)
of, free = partial(partial, lru_cache(build_scene)), partial(partial, block, ground=(0.0, 0.0, 0.0))
slider, damped, constant = of("sdof_slider"), of("sdof_slider", damping=20.0), of("sdof_slider", normal_stiffness=0.0)
masses, wall, cylinder = of("two_masses"), of("vibro_impact"), of("cylinder_on_flat", strips=12)
narrow, sphere = of("cylinder_on_flat", strips=12, half_width=8e-5), of("sphere_on_flat", patches=4)
root, wave = of("dovetail_sector", mesh=1), of("dovetail_sector", mesh=1, nodal_diameter=3)
seventh = of("dovetail_sector", mesh=1, nodal_diameter=7)
shroud, damper = of("shrouded_sector", nodal_diameter=2), of("underplatform_damper", nodal_diameter=2)
singular = of("two_masses", stiffness_1=3.0, damping_1=0.0, damping_2=0.0)
mass = partial(build_model, [[0.1]], None, [[0.0]], [[-1, 0, -1]], 1e-4, load_harmonic=[1.0], normal_load=10.0)
bouncing, kinds = partial(block, lift=0.2), partial(block, (0, 1, 2), (0, 1), (0, 2), (0,), (1, 2), (1,))
held = partial(block, (0, 1), (0, 1), ground=(1e9, 0.0, 1e5), static=(3400.0, 0.0, 0.0))
ring, other_ring, beam = partial(one_sector, 3), partial(one_sector, 5), Cantilever().model
equal_ring, deviating = (lambda d=d, off=off: solver.build_ring(one_sector(d), off) for d, off in ((2, 0.0), (1, OFF)))
FEW, FIVE, MANY = SolverSettings(3, 64), SolverSettings(5, 64), SolverSettings(19, 256)
FINE, COARSE, RANGE = SolverSettings(rtol=1e-3), SolverSettings(rtol=3e-2), {"between": (180.0, 230.0)}
WEAR, LONG, END, WAYS = 1.1e-11, 8e4, math.inf, ("up", "down", "ramp")
TABLE = WearTable((6e4, 9e4), (0.0, 1.5e-5, 4e-5), ((0.5, 2.0, 1.0), (1.5, 0.5, 0.8)))
LAWS = WearLaw("energy"), WearLaw("threshold", threshold=40.0), WearLaw("table", table=TABLE)
SCAR = 1e-6 * np.array([0.01, 0.1, 0.0, 0.0, 0.97, 1.97, 7.18, 7.37, 7.19, 7.38, 0.98, 1.98, 0.0, 0.0, 0.01, 0.1])
BOTH = [(160.0, 10.0, 200.0, "continue"), (150.0, 14.0, 300.0, "continue")]
PASSING = [(Passage(180.0, 220.0, 0.5), 10.0), (190.0, 10.0, 2e3, "continue"), (Passage(210.0, 185.0, 0.5), 10.0)]
slides, roots = partial(worn, slider, 160.0, 10.0, 0.5, WEAR), partial(worn, root, 212.42, 0.5, 0.5, WEAR)
presses, follows = partial(worn, cylinder, 20.0, 1.0, 0.6, 1e-13, sweep="ramp"), partial(worn, damped)
GIVEN = {"implicit": {"scheme": "implicit", "step": 1e3}, "explicit": {"scheme": "explicit", "step": 500.0}}

CASES: dict[str, Any] = {
    **{f"starts: slider {way}": slides(0.0, sweep=way, settings=FINE) for way in WAYS},
    **{f"starts: root {way}": roots(0.0, sweep=way) for way in WAYS},
    "starts: two masses": worn(masses, 0.1, 20.0, 0.5, WEAR, 0.0, sweep="down"),
    "starts: impacts": worn(bouncing, 100.0, 400.0, 0.4, 1e-12, 0.0, settings=MANY),
    "responses: slider": swept(damped, [150.0, 180.0], 10.0, 0.5),
    "responses: impacts up": swept(wall, [0.2, 0.255], 0.02, 0.0),
    "responses: impacts down": swept(wall, [0.17, 0.2], 0.02, 0.0, sweep="down", settings=MANY),
    "responses: root": swept(root, [211.5, 212.5], 0.5, 0.5),
    "responses: worn root": swept(root, [212.5], 0.5, 0.5, wear_depth=SCAR),
    "responses: compliant": swept(of("sdof_slider", contact_stiffness=1e10), [150.0], 10.0, 0.5),
    "responses: beam": swept(beam, [0.48 / math.pi], 3.0, 1.0),
    "responses: curve over frequency": curve(wall, (0.2, 0.26), 0.02, 0.0, settings=MANY),
    "responses: curve over load": curve(slider, 160.0, (8.0, 12.0), 0.5, settings=FIVE),
    "waves: ring": swept(ring, [320.0], 12.0, 0.3),
    "waves: ring, backwards": worn(other_ring, 280.0, 3.3, 0.3, 1e-10, 300.0),
    "waves: all sectors, deviating": worn(deviating, 280.0, 3.3, 0.3, 1e-10, 100.0),
    "waves: all sectors, another wave grows": worn(equal_ring, 300.0, 10.0, 0.3, 1e-10, 100.0),
    "waves: root": worn(wave, 214.42, 1.5, 0.5, WEAR, 3000.0),
    "waves: root, long steps": worn(seventh, 214.78431461633312, 0.5, 0.5, WEAR, 1e4, scheme="implicit", step=2e3),
    "waves: shroud": worn(shroud, 476.0, 0.1, 0.3, 1e-11, 1e5),
    "waves: shroud, resonance": worn(shroud, "resonance", 0.1, 0.3, WEAR, 0.0, between=(350.0, 850.0)),
    "waves: damper": swept(damper, [260.0], 0.2, 0.3),
    "waves: damper, resonance": worn(damper, "resonance", 0.2, 0.3, WEAR, 0.0, between=(240.0, 295.0), settings=FIVE),
    "histories: adaptive": slides(LONG),
    **{f"histories: slider, {name}": slides(2e4, **scheme) for name, scheme in GIVEN.items()},
    "histories: final": presses(END, scheme="final", settings=FEW),
    "histories: to the end": presses(END, outputs=9),
    **{f"histories: law {law.name}": slides(LONG, law=law) for law in LAWS},
    "histories: worn start": slides(4e4, wear_depth=[2e-5], law=WearLaw(surfaces=(("support", 0.8),))),
    "histories: to a depth": slides([2e4, LONG], until=WearTarget("wear_depth", 3e-5)),
    "histories: to a shift": slides([5e3, LONG], until=WearTarget("frequency_shift", 2e-3)),
    "histories: sphere": worn(sphere, 20.0, 1.0, 0.6, 1e-13, 1e4, sweep="ramp"),
    "histories: root": roots(1e5),
    **{f"histories: root, {name}": roots(1e4, **scheme) for name, scheme in GIVEN.items()},
    "histories: worn root": roots(2e4, wear_depth=SCAR, settings=FIVE),
    "followed: resonance": follows("resonance", 10.0, 0.5, WEAR, 4e4, **RANGE),
    "followed: explicit": follows("resonance", 10.0, 0.5, WEAR, 4e3, sweep="down", **GIVEN["explicit"], **RANGE),
    "followed: peak": follows("peak", 10.0, 0.5, WEAR, 4e4, **RANGE),
    "followed: to the end": follows("resonance", 10.0, 0.5, WEAR, END, outputs=3, settings=FEW, **RANGE),
    "joints: block": worn(block, 100.0, 60.0, 0.4, 1e-12, 1e5),
    "joints: all kinds of pairs": worn(kinds, 100.0, 200.0, 0.4, 1e-12, 1e4, settings=FIVE),
    "joints: impacts": worn(bouncing, 100.0, 250.0, 0.4, 1e-12, 1e4),
    "joints: held by friction": worn(free(), 100.0, 120.0, 0.4, 1e-12, 1e3),
    "joints: comes loose": worn(held, 100.0, 30.0, [0.2, 0.4], 3e-11, 2e5, settings=FIVE),
    "joints: all of the root slides": worn(root, 212.0, 1.0, 0.3, WEAR, 2e4, settings=COARSE),
    "joints: sliding mass": worn(mass, 160.0, 10.0, 0.5, WEAR, 1e4),
    "missions: one by one": flown(slider, BOTH, WEAR, 3, settings=FEW),
    "missions: many": flown(slider, [(160.0, 10.0, 1e3, "ramp")], WEAR, 40),
    "missions: passages": flown(damped, PASSING, WEAR, 2),
    "missions: to a target": flown(slider, BOTH, WEAR, [20, 80], settings=FEW, until=WearTarget("worn_volume", 1e-9)),
    "missions: root": flown(root, [(212.4, 0.5, 1e3), (212.6, 0.5, 1e3, "continue")], WEAR, 2),
    "modes: slider": mode(constant, [2e-5, 1e-4], 0.5, sweep="down"),
    "modes: impacts": mode(wall, [0.15, 0.3], 0.0),
    "modes: root": mode(root, [5e-4], 0.5),
    "modes: worn root": mode(root, [5e-4], 0.5, wear_depth=SCAR),
    "modes: ring": mode(ring, [2e-5, 3e-5], 0.3),
    "failures: singular": swept(singular, [1.0 / math.pi], 20.0, 0.5, settings=FEW),
    "failures: period doubled": swept(wall, [0.146], 0.02, 0.0, settings=MANY),
    "failures: certificate": swept(wall, [0.5 / math.pi], 2e3, 0.0, settings=FEW),
    "failures: unsettled": swept(free(lift=0.3), [100.0], 1e3, 0.4, settings=FEW),
    "failures: adrift": swept(free(static=(100.0, 39.0, 0.0)), [100.0], 60.0, 0.4, settings=FEW),
    "failures: static open": swept(free(static=(-1.0, 0.0, 0.0)), [100.0], 60.0, 0.4, settings=FEW),
    "failures: static sliding": swept(free(static=(100.0, 60.0, 0.0)), [100.0], 60.0, 0.4, settings=FEW),
    "failures: time limit": slides(LONG, settings=SolverSettings(3, 64, time_limit=1e-9)),
    "failures: step too long": slides(1e9, scheme="explicit", step=1e9),
    "failures: march failed": roots(2e4, scheme="implicit", step=2000.0, settings=FEW),
    "failures: no final state": worn(constant, 160.0, 10.0, 0.5, WEAR, END, outputs=4, settings=FEW),
    "failures: resonance lost": follows("resonance", 10.0, 0.5, WEAR, [5e3, 4e4], between=(180.0, 200.3)),
    "failures: cut off": worn(narrow, 20.0, 1.0, 0.6, 1e-13, 1e5, sweep="ramp", settings=FEW),
    "failures: sensitive": worn(held, 100.0, 33.0, [0.2, 0.4], 1e-12, 1e5, settings=FIVE),
    "failures: no mode": mode(constant, [1e-4], 0.5),
    "failures: mode lost": mode(constant, [5e-6, 1e-4], 0.5, sweep="down"),
}
GROUPS = list(dict.fromkeys(name.split(":")[0] for name in CASES))


def computed(groups: Sequence[str]) -> Iterator[list[str]]:
    """Rows of all cases of some groups, computed now: a row with the outcome as value, then those of the values."""
    for name in (name for name in CASES if name.split(":")[0] in groups):
        compute, read, model = CASES[name]
        structure = model()
        measured = measure(lambda: compute(structure))  # noqa: B023
        found, counts = measured.result, [str(measured.iterations), f"{measured.seconds:.3f}"]
        outcomes, messages = ([*of] if isinstance(of, tuple) else [of] for of in (found.outcome, found.message))
        yield [name, "outcome", " ".join(map(str, outcomes)), "nan", "; ".join(filter(None, messages)), *counts]
        with np.errstate(all="ignore"):
            values = [(quantity, value, error) for quantity, value, error in read(found) if not np.isnan(value)]
        for quantity, value, error in values:
            yield [name, quantity, f"{value:.17g}", f"{error:.17g}", "", "0", "0"]


def verdict(before: list[str], now: list[str]) -> tuple[float, str]:
    """Relative difference of a value to that before, and what it is."""
    if now[1] == "outcome":
        return math.nan, "equal" if before[2] == now[2] else f"OUTCOME {now[2]}, was {before[2]}"
    old, new = complex(before[2]), complex(now[2])
    difference = abs(new - old) / (max(abs(new), abs(old)) or 1.0)
    errors = float(before[3]), float(now[3])
    least, both = (min(errors), sum(errors)) if math.isfinite(sum(errors)) else (0.0, 0.0)
    limits = {"equal": 0.0, "round-off": ROUND_OFF, "within": max(least, SOLVED), "together": max(both, SOLVED)}
    return difference, next((word for word, limit in limits.items() if difference <= limit), "OUTSIDE")


def compare(file: Path, groups: Sequence[str]) -> bool:
    """Prints all values beside those of a file; whether none is outside or gone, and all outcomes are as before."""
    with file.open(encoding="utf-8", newline="") as stream:
        old = {(row[0], row[1]): row for row in csv.reader(stream) if row[0].split(":")[0] in groups}
    table = Table("value", "difference", "error before", "error now", "verdict")
    words, sums = list[str](), {group: np.zeros(4) for group in groups}
    for now in computed(groups):
        difference, said = verdict(old[now[0], now[1]], now) if (now[0], now[1]) in old else (math.nan, "new")
        before = old.pop((now[0], now[1]), now)
        words.append(said.split()[0])
        numbers = (difference, float(before[3]), float(now[3]))
        table.row(", ".join(now[:2]), *(None if math.isnan(number) else number for number in numbers), said)
        sums[now[0].split(":")[0]] += [float(row[place]) for place in (5, 6) for row in (before, now)]
        if now[4] != before[4]:
            print(f"    message: {now[4]}\n    before:  {before[4]}")
    for gone in old:
        words.append("GONE")
        table.row(", ".join(gone), None, None, None, "GONE")
    totals = Table("group", "iterations before", "now", "CPU s before", "now")
    for group, total in (*sums.items(), ("all", sum(sums.values()))):
        totals.row(group, *map(float, total))
    print(", ".join(f"{words.count(word)} {word}" for word in sorted(set(words))))
    return not any(map(str.isupper, words))


def main() -> None:
    given = arguments(__doc__, write=None, compare=None, only=GROUPS)
    if not given.only or not set(GROUPS) >= set(given.only) or (given.write is None) == (given.compare is None):
        sys.exit(f"give --write FILE.csv or --compare FILE.csv, and after --only some of {', '.join(GROUPS)}")
    if given.compare:
        sys.exit(0 if compare(given.compare, given.only) else 1)
    with given.write.open("w", encoding="utf-8", newline="") as stream:
        rows = csv.writer(stream, lineterminator="\n")
        rows.writerow(("case", "quantity", "value", "error", "message", "iterations", "seconds"))
        rows.writerows(computed(given.only))


if __name__ == "__main__":
    main()
