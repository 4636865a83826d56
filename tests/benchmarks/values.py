"""Values of all kinds that the solver computes, against those that it computed before: equal, or explained.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.values --compare tests/benchmarks/values.csv [--only GROUP ...]
    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.values --write FILE.csv [--only GROUP ...]

A case ends with an outcome, a message, Newton iterations and CPU seconds, and has values with estimated errors. A value
is "equal" to the bit, differs by "round-off", is "within" the smaller one of its errors before and now, or "OUTSIDE" of
it; an error that is not known allows nothing. "GONE" is a value that there is no longer, and "OUTCOME" another outcome:
each of the words in capitals gives the status 1. Another message is only printed. Differences and errors are relative.
Values that have no meaning to round-off, as a wear rate that has come to its end, are left out.
"""

import csv
import math
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from solver import (
    Block,
    Outcome,
    Passage,
    ReducedModel,
    SolverSettings,
    backbone,
    balance_of,
    build_model,
    frequency_response,
    integrate_mission,
    march_wear,
    modal_response,
    response_curve,
)
from solver.contact.wear_law import WearLaw, WearTable
from solver.settings import WearTarget
from studies import build_scene
from tests.benchmarks.frame import Table, arguments, measure
from tests.cantilever import Cantilever
from tests.rings import one_sector

ROUND_OFF = 1e-9
SOLVED = 1e-7
"""To this much of its size a value is known at most, where its estimated error is smaller: states are solved to a
residual of 1e-8, which the estimates do not hold. Measured with 1e-10: the root at 212.42 Hz differs by 3e-8, all other
states by less than 1e-8."""
FOLD_ERROR = 1e-3
"""Of the frequency or load of a fold, relative; the solver does not estimate it."""

Values = dict[str, tuple[complex, float]]
"""By their names: values and their estimated absolute errors."""
Found = tuple[Values, Sequence[Outcome], Sequence[str]]
"""Values, outcomes and messages of a case."""

# --- what is computed, and the values that are taken from it ---


def _known_to(value: complex, error: float) -> tuple[complex, float]:
    """A value with its absolute error, from a relative one."""
    return value, error * abs(value) if value else 0.0


def sweep(model: ReducedModel, frequency: Sequence[float], *given: Any, **named: Any) -> Found:
    """First response, its peak, and the last fold, at each frequency."""
    found, values = frequency_response(model, frequency, *given, **named), Values()
    for row, at in enumerate(found.frequency):
        for name in ("response", "response_peak"):
            values[f"{name} {at:.6g} Hz"] = _known_to(getattr(found, name)[row, 0], found.response_error[row])
        values[f"fold {at:.6g} Hz"] = _known_to(found.fold_frequency[row], FOLD_ERROR)
    return values, found.outcome, found.message


def balance(model: ReducedModel, *given: Any, **named: Any) -> Found:
    """Harmonics of the first response, and mean force of the first pair: as well known as the response."""
    (error,), found = frequency_response(model, *given, **named).response_error, balance_of(model, *given, **named)
    motion = found.motion()
    least = float(error * abs(motion.response[0, 1]))
    values: Values = {f"harmonic {order}": (motion.response[0, order], least) for order in (1, 3)}
    values["mean force"] = _known_to(motion.contact_force[0, 0, 0].real, error)
    return values, [found.outcome], [found.message]


def history(model: ReducedModel, *given: Any, **named: Any) -> Found:
    """The last state that was reached: a start state with wear rate and energy error, or with what has worn."""
    found, values = march_wear(model, *given, **named), Values()
    values["cycles to target"] = found.cycles_to_target, found.cycles_to_target_error
    for row in np.flatnonzero(np.isfinite(found.worn_volume))[-1:]:
        values["response"] = _known_to(found.response[row, 0], found.response_error[row])
        if found.excitation_frequency_error[row] > 0.0:
            values["frequency"] = found.excitation_frequency[row], found.excitation_frequency_error[row]
        if row == 0:
            values["wear rate"] = _known_to(found.wear_rate[row], found.wear_rate_error[row])
            values["energy error"] = found.energy_error[row], max(ROUND_OFF, found.wear_rate_error[row])
        else:
            pair = int(found.wear_depth[row].argmax())
            values["volume"] = _known_to(found.worn_volume[row], found.worn_volume_error[row])
            values["deepest"] = found.wear_depth[row, pair], found.wear_depth_error[row, pair]
    return values, [found.outcome], [found.message]


def mission(
    model: ReducedModel, blocks: Sequence[tuple[Any, ...]], friction: float, *given: Any, **named: Any
) -> Found:
    """What has worn to the last mission that was reached, and its last vibration.

    blocks: frequency, N, and for a steady one cycles and how it begins.
    """
    found = integrate_mission([Block(model, at, load, friction, *more) for at, load, *more in blocks], *given, **named)
    values: Values = {"missions to target": (found.missions_to_target, found.missions_to_target_error)}
    for row in np.flatnonzero(np.isfinite(found.worn_volume))[-1:]:
        pair = int(found.wear_depth[row].argmax())
        values["volume"] = _known_to(found.worn_volume[row], found.worn_volume_error[row])
        values["deepest"] = found.wear_depth[row, pair], found.wear_depth_error[row, pair]
        values["last block"] = _known_to(found.block_volume[row, -1], found.block_volume_error[row, -1])
        values["last response"] = _known_to(found.response_end[row, -1, 0], found.response_error[row, -1])
    return values, [found.outcome], [found.message]


def mode(model: ReducedModel, amplitude: Sequence[float], *given: Any, **named: Any) -> Found:
    """Frequency and damping at each amplitude; of some amplitudes also the peak of the response to 0.5 N."""
    found, values = backbone(model, amplitude, *given, **named), Values()
    for row, at in enumerate(found.amplitude):
        values[f"frequency {at:g}"] = found.frequency[row], found.frequency_error[row]
        values[f"damping {at:g}"] = found.damping_ratio[row], found.damping_error[row]
    if len(amplitude) > 2:
        peak = np.nanmax(abs(modal_response(model, found, 0.5).response[:, 0]))
        values["peak"] = _known_to(peak, float((found.damping_error / found.damping_ratio).max()))
    return values, found.outcome, found.message


def curve(model: ReducedModel, *given: Any, **named: Any) -> Found:
    """The last state with its largest multiplier, and the folds on the way."""
    found = response_curve(model, *given, **named)
    folds, values = getattr(found, found.parameter)[found.is_fold], Values()
    for row in range(len(found.response))[-1:]:
        values["response"] = _known_to(found.response[row, 0], found.response_error[row])
        values["multiplier"] = abs(found.multipliers[row][0]), found.multiplier_error[row]
    return (
        values | {f"fold {n}": _known_to(fold, FOLD_ERROR) for n, fold in enumerate(folds)},
        [found.outcome],
        [found.message],
    )


# --- models ---


def block(
    *pairs: tuple[int, ...],
    ground: Sequence[float] = (1e5, 1e5, 1e5),
    pressed: float = 100.0,
    sheared: float = 0.0,
    lift: float = 0.0,
) -> ReducedModel:
    """A rigid block of 1 kg on elastic pairs without mass, which vibrates along both tangents.

    pairs: components of each: closing, first and second tangent; two with all of them if not given. ground: N/m, all
    that holds the block but friction. pressed, sheared: N, constant. lift: vibrating force along the normal over that
    along the first tangent.
    """
    pairs = pairs or 2 * ((0, 1, 2),)
    places, components = np.array([(place, component) for place, pair in enumerate(pairs) for component in pair]).T
    n, dofs = 3 + components.size, np.full((len(pairs), 3), -1)
    ties, springs = np.eye(n)[components] - np.eye(n)[3:], 1e7 * (1 + places) * np.where(components > 0, 0.5, 1.0)
    dofs[places, components] = np.arange(3, n)
    stiffness = ties.T @ np.diag(springs) @ ties + np.diag([*ground, *np.zeros(n - 3)])
    static, harmonic = np.zeros(n), np.zeros(n, complex)
    static[:2], harmonic[:3] = (pressed, sheared), (lift, 1.0, 0.5j)
    loads = {
        "load_static": static,
        "load_harmonic": harmonic,
        "normal_load": np.where(dofs[:, 0] < 0, 0.5 * pressed, 0.0),
    }
    return build_model(
        np.diag([1.0] * 3 + [0.0] * (n - 3)), 9e-6 * stiffness, stiffness, dofs, 1e-4, response=[1, 2], **loads
    )


def foot() -> ReducedModel:
    """A pressed foot with a tip on a spring above it."""
    stiffness = np.array([[1e7, 0.0, 0.0], [0.0, 4e6, -2e6], [0.0, -2e6, 2e6]])
    loads = {"load_static": [50.0, 0.0, 0.0], "load_harmonic": [0.0, 0.0, 1.0], "response": [2]}
    return build_model(np.diag([1e-3, 1e-3, 0.2]), 1e-5 * stiffness, stiffness, [[0, 1, -1]], 1e-4, **loads)


def driven() -> ReducedModel:
    """Two masses, the second on a slider, whose damping feeds energy in."""
    loads = {"load_harmonic": [1.0, 0.0], "normal_load": 14.4}
    return build_model(np.eye(2), np.diag([-0.5, 0.02]), [[2.0, -1.0], [-1.0, 1.0]], [[-1, 1, -1]], 1e-4, **loads)


def free_mass() -> ReducedModel:
    """A mass on a slider that nothing else holds."""
    return build_model([[0.1]], None, [[0.0]], [[-1, 0, -1]], 1e-4, load_harmonic=[1.0], normal_load=10.0)


root = partial(build_scene, "dovetail_sector", mesh=1)
FREE = (0.0, 0.0, 0.0)
MODELS: dict[str, Callable[[], ReducedModel]] = {
    "slider": partial(build_scene, "sdof_slider"),
    "damped slider": partial(build_scene, "sdof_slider", damping=20.0),
    "constant slider": partial(build_scene, "sdof_slider", normal_stiffness=0.0),
    "compliant slider": partial(build_scene, "sdof_slider", contact_stiffness=1e10),
    "two masses": partial(build_scene, "two_masses"),
    "singular": partial(build_scene, "two_masses", stiffness_1=3.0, damping_1=0.0, damping_2=0.0),
    "wall": partial(build_scene, "vibro_impact"),
    "cylinder": partial(build_scene, "cylinder_on_flat", strips=12),
    "narrow cylinder": partial(build_scene, "cylinder_on_flat", strips=12, half_width=8e-5),
    "sphere": partial(build_scene, "sphere_on_flat", patches=4),
    "root": root,
    "root wave": partial(root, nodal_diameter=3),
    "shroud": partial(build_scene, "shrouded_sector", nodal_diameter=2),
    "damper": partial(build_scene, "underplatform_damper", nodal_diameter=2),
    "ring 3": partial(one_sector, 3),
    "ring 5": partial(one_sector, 5),
    "beam": lambda: Cantilever().model(),
    "sprung beam": lambda: Cantilever(spring=20.0).model(),
    "block": block,
    "all kinds": partial(block, (0, 1, 2), (0, 1), (0, 2), (0,), (1, 2), (1,)),
    "bouncing block": partial(block, lift=0.2),
    "free block": partial(block, ground=FREE),
    "held block": partial(block, (0, 1), (0, 1), ground=(1e9, 0.0, 1e5), pressed=3400.0),
    "drifting block": partial(block, ground=FREE, sheared=39.0),
    "loose block": partial(block, ground=FREE, lift=0.3),
    "sliding block": partial(block, ground=FREE, sheared=60.0),
    "open block": partial(block, ground=FREE, pressed=-1.0),
    "foot": foot,
    "driven": driven,
    "free mass": free_mass,
}
build = lru_cache(lambda name: MODELS[name]())

# --- cases ---

Case = tuple[Callable[..., Found], str, tuple[Any, ...], dict[str, Any]]
"""What is called with a model of this name, and with these arguments."""


def case(function: Callable[..., Found], model: str, *given: Any, **named: Any) -> Case:
    """A row of the tables."""
    return function, model, given, named


FEW, FIVE, MANY = SolverSettings(3, 64), SolverSettings(5, 64), SolverSettings(19, 256)
FINE, COARSE, NO_TIME = SolverSettings(rtol=1e-3), SolverSettings(rtol=3e-2), SolverSettings(3, 64, time_limit=1e-9)
WEAR, LONG, END, RANGE = 1.1e-11, 8e4, math.inf, (180.0, 230.0)
TABLE = WearTable((6e4, 9e4), (0.0, 1.5e-5, 4e-5), ((0.5, 2.0, 1.0), (1.5, 0.5, 0.8)))
SCAR = 1e-6 * np.array([0.01, 0.1, 0.0, 0.0, 0.97, 1.97, 7.18, 7.37, 7.19, 7.38, 0.98, 1.98, 0.0, 0.0, 0.01, 0.1])
BOTH = [(160.0, 10.0, 200.0, "continue"), (150.0, 14.0, 300.0, "continue")]
PASSING = [(Passage(180.0, 220.0, 0.5), 10.0), (190.0, 10.0, 2e3, "continue"), (Passage(210.0, 185.0, 0.5), 10.0)]

slides = partial(case, history, "slider", 160.0, 10.0, 0.5, WEAR)
of_root = partial(case, history, "root", 212.42, 0.5, 0.5, WEAR)
presses = partial(case, history, "cylinder", 20.0, 1.0, 0.6, 1e-13, sweep="ramp")
follows = partial(case, history, "damped slider")
on_block = partial(case, sweep, settings=FEW)

CASES: dict[str, dict[str, Case]] = {
    "starts": {
        "slider up": slides(0.0),
        "slider down": slides(0.0, sweep="down", settings=FINE),
        "slider ramp": slides(0.0, sweep="ramp"),
        "two masses": case(history, "two masses", 0.1, 20.0, 0.5, WEAR, 0.0, sweep="down"),
        "free mass": case(history, "free mass", 160.0, 10.0, 0.5, WEAR, 0.0),
        "root up": of_root(0.0),
        "root down": of_root(0.0, sweep="down"),
        "root ramp": of_root(0.0, sweep="ramp"),
        "cylinder": presses(0.0),
        "sphere": case(history, "sphere", 20.0, 1.0, 0.6, 1e-13, 0.0, sweep="ramp"),
        "impacts": case(history, "bouncing block", 100.0, 400.0, 0.4, 1e-12, 0.0, settings=MANY),
    },
    "responses": {
        "slider": case(sweep, "damped slider", [150.0, 180.0, 220.0], 10.0, 0.5),
        "two masses": case(sweep, "two masses", [0.06, 0.25], 20.0, 0.5, sweep="down"),
        "impacts up": case(sweep, "wall", [0.2, 0.255], 0.02, 0.0),
        "impacts down": case(sweep, "wall", [0.17, 0.2], 0.02, 0.0, sweep="down", settings=MANY),
        "root": case(sweep, "root", [211.5, 212.5, 213.5], 0.5, 0.5),
        "worn root": case(sweep, "root", [212.5], 0.5, 0.5, wear_depth=SCAR),
        "compliant": case(sweep, "compliant slider", [150.0], 10.0, 0.5),
        "beam": case(sweep, "beam", [0.48 / math.pi], 3.0, 1.0),
        "sprung beam": case(sweep, "sprung beam", [0.5 / math.pi], 3.0, 1.0),
        "balance": case(balance, "foot", 500.0, 60.0, 0.5, settings=FIVE),
        "curve over frequency": case(curve, "wall", (0.2, 0.26), 0.02, 0.0, settings=MANY),
        "curve over load": case(curve, "slider", 160.0, (8.0, 12.0), 0.5, settings=FIVE),
    },
    "waves": {
        "ring": case(sweep, "ring 3", [320.0], 12.0, 0.3),
        "ring unstable": case(history, "ring 5", 280.0, 3.3, 0.3, 1e-10, 300.0),
        "root": case(history, "root wave", 214.42, 1.5, 0.5, WEAR, 3000.0),
        "shroud": case(history, "shroud", 476.0, 0.1, 0.3, 1e-11, 1e5),
        "shroud resonance": case(history, "shroud", "resonance", 0.1, 0.3, 0.0, 0.0, between=(350.0, 850.0)),
        "damper": case(sweep, "damper", [260.0], 0.2, 0.3),
        "damper resonance": case(
            history, "damper", "resonance", 0.2, 0.3, 1e-11, 0.0, between=(240.0, 295.0), settings=FEW
        ),
    },
    "histories": {
        "adaptive": slides(LONG),
        "adaptive fine": slides(LONG, settings=FINE),
        "implicit": slides(LONG, scheme="implicit", step=4000.0),
        "explicit": slides(LONG, scheme="explicit", step=2000.0),
        "final": presses(END, scheme="final", settings=FEW),
        "to the end": presses(END, outputs=9),
        "to the end implicit": presses(END, outputs=9, scheme="implicit", step=1000.0, settings=FEW),
        "energy": slides(LONG, law=WearLaw("energy")),
        "threshold": slides(LONG, law=WearLaw("threshold", threshold=40.0)),
        "table": slides(LONG, law=WearLaw("table", table=TABLE)),
        "surfaces": slides(LONG, law=WearLaw(surfaces=(("support", 0.3),))),
        "worn start": slides(4e4, wear_depth=[2e-5]),
        "to a depth": slides([2e4, LONG], until=WearTarget("wear_depth", 3e-5)),
        "to a shift": slides([5e3, LONG], until=WearTarget("frequency_shift", 2e-3)),
        "sphere": case(history, "sphere", 20.0, 1.0, 0.6, 1e-13, 1e4, sweep="ramp"),
        "root": of_root(1e5),
        "root down": of_root(2e4, sweep="down"),
        "root implicit": of_root(1e4, scheme="implicit", step=1000.0),
        "root explicit": of_root(1e4, scheme="explicit", step=500.0),
        "worn root": of_root(2e4, wear_depth=SCAR, settings=FIVE),
    },
    "followed": {
        "resonance": follows("resonance", 10.0, 0.5, WEAR, 4e4, between=RANGE),
        "resonance explicit": follows(
            "resonance", 10.0, 0.5, WEAR, 4e4, scheme="explicit", step=5e3, between=RANGE, sweep="down"
        ),
        "peak": follows("peak", 10.0, 0.5, WEAR, 4e4, between=RANGE),
        "to the end": follows("resonance", 10.0, 0.5, WEAR, END, between=RANGE, outputs=3, settings=FEW),
    },
    "joints": {
        "block": case(history, "block", 100.0, 60.0, 0.4, 1e-12, 1e5),
        "all kinds of pairs": case(history, "all kinds", 100.0, 200.0, 0.4, 1e-12, 1e4, settings=FIVE),
        "impacts": case(history, "bouncing block", 100.0, 250.0, 0.4, 1e-12, 1e4),
        "held by friction": case(history, "free block", 100.0, 120.0, 0.4, 1e-12, 1e3),
        "comes loose": case(history, "held block", 100.0, 30.0, [0.2, 0.4], 3e-11, 2e5, settings=FIVE),
        "all of the root slides": case(history, "root", 212.0, 1.0, 0.3, WEAR, 2e4, settings=COARSE),
        "sliding mass": case(history, "free mass", 160.0, 10.0, 0.5, WEAR, 1e4),
        "two masses": case(history, "two masses", 0.1, 20.0, 0.5, 1e-11, 1e5),
    },
    "missions": {
        "one by one": case(mission, "slider", BOTH, 0.5, WEAR, 3, settings=FEW),
        "many": case(mission, "slider", [(160.0, 10.0, 1e3, "ramp")], 0.5, WEAR, 40),
        "passages": case(mission, "damped slider", PASSING, 0.5, WEAR, 2),
        "to a target": case(
            mission, "slider", BOTH, 0.5, WEAR, [20, 80], settings=FEW, until=WearTarget("worn_volume", 1e-9)
        ),
        "root": case(mission, "root", [(212.4, 0.5, 1e3), (212.6, 0.5, 1e3, "continue")], 0.5, WEAR, 2),
    },
    "modes": {
        "foot": case(mode, "foot", [8e-6, 2e-5, 1e-4], 0.5, settings=MANY),
        "foot automatic": case(mode, "foot", [2e-5, 3e-3], 0.5),
        "slider down": case(mode, "constant slider", [2e-5, 1e-4], 0.5, sweep="down"),
        "impacts": case(mode, "wall", [0.15, 0.3], 0.0),
        "root": case(mode, "root", [5e-4], 0.5),
        "worn root": case(mode, "root", [5e-4], 0.5, wear_depth=SCAR),
        "ring": case(mode, "ring 3", [1e-4], 0.3),
    },
    "failures": {
        "singular": on_block("singular", [1.0 / math.pi], 20.0, 0.5),
        "period doubled": case(sweep, "wall", [0.146], 0.02, 0.0, settings=MANY),
        "certificate": on_block("wall", [0.5 / math.pi], 2e3, 0.0),
        "unstable": on_block("driven", [0.05], 20.0, 0.5),
        "unsettled": on_block("loose block", [100.0], 1e3, 0.4),
        "adrift": on_block("drifting block", [100.0], 60.0, 0.4),
        "static open": on_block("open block", [100.0], 60.0, 0.4),
        "static sliding": on_block("sliding block", [100.0], 60.0, 0.4),
        "time limit": case(sweep, "block", [100.0], 60.0, 0.4, settings=NO_TIME),
        "step too long": slides(1e4 * LONG, scheme="explicit", step=1e4 * LONG),
        "march failed": of_root(2e4, scheme="implicit", step=2000.0, settings=FEW),
        "no final state": case(history, "constant slider", 160.0, 10.0, 0.5, WEAR, END, outputs=4, settings=FEW),
        "no resonance": follows("resonance", 10.0, 0.5, WEAR, 4e4, between=(100.0, 150.0)),
        "resonance lost": follows("resonance", 10.0, 0.5, WEAR, [5e3, 4e4], between=(180.0, 200.3)),
        "cut off": case(history, "narrow cylinder", 20.0, 1.0, 0.6, 1e-13, 1e5, sweep="ramp", settings=FEW),
        "sensitive": case(history, "held block", 100.0, 33.0, [0.2, 0.4], 1e-12, 1e5, settings=FIVE),
        "curve": case(curve, "wall", (0.2, 0.26), 0.02, 0.0, settings=MANY, most_points=4, errors=False),
        "no mode": case(mode, "constant slider", [1e-4], 0.5),
        "mode lost": case(mode, "constant slider", [5e-6, 1e-4], 0.5, sweep="down"),
    },
}


class Row(NamedTuple):
    """A value with its absolute error; or, without quantity, how its case has ended."""

    group: str
    case: str
    quantity: str
    value: complex = math.nan
    error: float = math.nan
    outcome: str = ""
    message: str = ""
    iterations: int = 0
    seconds: float = 0.0

    @property
    def place(self) -> tuple[str, str, str]:
        """What it is."""
        return self[:3]


def computed(groups: Sequence[str]) -> Iterator[Row]:
    """The rows of all cases of some groups, computed now."""
    for group in groups:
        for name, (function, model, given, named) in CASES[group].items():
            structure = build(model)
            found = measure(lambda: function(structure, *given, **named))  # noqa: B023
            values, outcomes, messages = found.result
            ends = " ".join(map(str, outcomes)), "; ".join(filter(None, messages))
            yield Row(group, name, "", math.nan, math.nan, *ends, found.iterations, found.seconds)
            for quantity, (value, error) in values.items():
                if not np.isnan(value):
                    yield Row(group, name, quantity, value, error)


def write(file: Path, rows: Iterator[Row]) -> None:
    with file.open("w", encoding="utf-8", newline="") as stream:
        table = csv.writer(stream, lineterminator="\n")
        table.writerow(Row._fields)
        for row in rows:
            print(*row, flush=True)
            table.writerow([*row.place, f"{row.value:.17g}", f"{row.error:.17g}", *row[5:8], f"{row.seconds:.3f}"])


def read(file: Path, groups: Sequence[str]) -> dict[tuple[str, str, str], Row]:
    with file.open(encoding="utf-8", newline="") as stream:
        lines = [line for line in csv.reader(stream) if line[0] in groups]
    rows = (
        Row(*line[:3], complex(line[3]), float(line[4]), *line[5:7], int(line[7]), float(line[8])) for line in lines
    )
    return {row.place: row for row in rows}


def verdict(before: Row, now: Row) -> str:
    """How a value or an outcome now is, beside that before."""
    if not now.quantity:
        return "equal" if before.outcome == now.outcome else f"OUTCOME {now.outcome}, not {before.outcome}"
    difference, size = abs(now.value - before.value), max(abs(now.value), abs(before.value))
    if difference <= ROUND_OFF * size:
        return "round-off" if difference else "equal"
    known = min(error if math.isfinite(error) else 0.0 for error in (before.error, now.error))
    return "within" if difference <= max(known, SOLVED * size) else "OUTSIDE"


def compare(file: Path, groups: Sequence[str]) -> bool:
    """Prints the table; whether all values are inside of their errors, and all outcomes as before."""
    old, said, sums = read(file, groups), list[str](), defaultdict[str, Any](lambda: np.zeros(4))
    table = Table("value", "size", "difference", "error before", "error now", "its before", "its now", "")
    for now in computed(groups):
        before = old.pop(now.place, None)
        said.append("new" if before is None else verdict(before, now))
        name, size, earlier = ", ".join(filter(None, now.place)), abs(now.value), before or now
        if now.quantity:
            parts = [
                float(part / size) if size else 0.0
                for part in (abs(now.value - earlier.value), earlier.error, now.error)
            ]
            table.row(name, float(size), *parts, None, None, said[-1])
            continue
        table.row(name, None, None, None, None, earlier.iterations, now.iterations, said[-1])
        sums[now.group] += earlier.iterations, now.iterations, earlier.seconds, now.seconds
        if now.message != earlier.message:
            print(f"    message: {now.message}\n    before:  {earlier.message}")
    for gone in old:
        said.append("GONE")
        table.row(", ".join(filter(None, gone)), *[None] * 6, said[-1])
    totals = Table("group", "its before", "its now", "s before", "s now")
    for group, total in (*sums.items(), ("all", sum(sums.values()))):
        totals.row(group, *map(float, total))
    for word in sorted({each.split()[0] for each in said}):
        print(f"{word}: {sum(each.split()[0] == word for each in said)}")
    return not any(each.split()[0].isupper() for each in said)


def main() -> None:
    given = arguments(__doc__, write=None, compare=None, only=list(CASES))
    if wrong := set(given.only).difference(CASES):
        sys.exit(f"--only {' '.join(wrong)}: give some of {', '.join(CASES)}")
    if (given.write is None) == (given.compare is None):
        sys.exit("give either --write FILE.csv or --compare FILE.csv")
    if given.write is not None:
        write(given.write, computed(given.only))
    elif not compare(given.compare, given.only):
        sys.exit(1)


if __name__ == "__main__":
    main()
