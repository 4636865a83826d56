"""What each tuning constant of the solver changes: every one halved and doubled on a fixed set of cases.

    OPENBLAS_NUM_THREADS=1 python -m tests.benchmarks.ablation [--cases quick] [--options ACCURACY WEAR] [--fields NAME]

The constants are the numeric fields of the option classes (`<room>/options.py` and `solver.settings`): one instance
each, which all modules share, so that a field is changed in place and put back afterwards. What compiled kernels read
is fixed when they are compiled and is not among them. A case that does not read a field is not run for it. Printed, of
all cases that read the field: how many change at all (to the last bit), outcomes that change, the largest relative
changes of the volume worn (of the response, for a start state) and of the estimated error, iterations and time over
those without the change. Fields without any effect are listed at the end: what they guard is not among the cases, or
they are not needed.
"""

import argparse
import hashlib
import re
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Any

import numpy as np

from solver.loading_history.start_states import follow_branch
from solver.model import ReducedModel
from solver.packing import pack
from solver.results.history import StartState
from solver.settings import Scheme, SolverSettings
from tests.random_scenes import random_scene
from tests.solver.models import march_wear, random_model, scene
from tests.solver.option_fields import all_options
from tests.solver.test_branch_loss import worn_wall

FACTORS = (0.5, 2.0)
WEAR = 1.1e-11  # 1/Pa
LIMIT = 300.0  # CPU seconds of a case: some constants out of place lead nowhere
AUTOMATIC = SolverSettings(time_limit=LIMIT)


@dataclass(frozen=True)
class Found:
    """What a case has come to. value: volume worn, m3, or response, m. digest: of all its numbers."""

    outcome: str
    value: float
    error: float
    iterations: int
    digest: str
    seconds: float


@dataclass(frozen=True)
class Case:
    """A computation that is run again and again."""

    name: str
    run: Callable[[], Found]


def found(result: Any, value: float, error: float, seconds: float) -> Found:
    """Of a start state or a history."""
    packed = pack([getattr(result, entry.name) for entry in fields(result) if entry.name != "run_time"])
    digest = hashlib.sha256(packed.text.encode())
    for array in packed.arrays:
        digest.update(array.tobytes())
    return Found(result.outcome.meaning, value, error, result.newton_iterations, digest.hexdigest(), seconds)


def start_of(
    model: ReducedModel, friction: float, amplitude: float, frequency: float, settings: SolverSettings, sweep: Any
) -> StartState:
    """Start state at a frequency, Hz."""
    return next(follow_branch(model, friction, amplitude, np.array([frequency]), sweep, settings))[1]


def cases_of(
    name: str,
    model: ReducedModel,
    friction: float,
    amplitude: float,
    frequency: float,
    marches: tuple[tuple[Scheme, float, float], ...],
    wear: float = WEAR,
    settings: SolverSettings = AUTOMATIC,
    sweep: str = "up",
) -> Iterator[Case]:
    """A start state, and marches (scheme, step, last count) from the one that the usual constants find."""

    @lru_cache
    def usual() -> StartState:
        return start_of(model, friction, amplitude, frequency, settings, sweep)

    def start() -> Found:
        begun = time.thread_time()
        state = start_of(model, friction, amplitude, frequency, settings, sweep)
        size = 0.0 if state.state is None else float(np.linalg.norm(state.state.displacement_h[..., 1:]))
        return found(state, size, max(state.response_error, state.wear_rate_error), time.thread_time() - begun)

    def march(scheme: Scheme, step: float, end: float) -> Found:
        begun = time.thread_time()
        cycles = np.linspace(0.0, end, 6)
        history = march_wear(model, friction, usual(), wear, step, scheme, cycles, settings)
        volume = history.worn_volume[np.isfinite(history.worn_volume)]
        reached = float(volume[-1]) if volume.size else 0.0
        return found(history, reached, history.error_estimate, time.thread_time() - begun)

    yield Case(f"{name}, start", start)
    for given in marches:
        yield Case(f"{name}, {given[0]}", lambda given=given: march(*given))


def quick_cases() -> Iterator[Case]:
    """A slider, two random joints, a mass that impacts on a wall until it no longer reaches it, a small dovetail."""
    yield from cases_of("slider", scene("sdof_slider"), 0.5, 10.0, 160.0, (("adaptive", 1.0, 2e4),))
    for seed, scheme in ((1, "implicit"), (4, "explicit")):
        joint = random_model(seed, ("3d", "one_tangent"))
        fixed = SolverSettings(5, 64, time_limit=LIMIT)
        yield from cases_of(f"joint {seed}", joint, 0.4, 90.0, 95.0, ((scheme, 1e4, 5e4),), settings=fixed)
    marches, fixed = (("adaptive", 1.0, 1000.0),), SolverSettings(11, 128, time_limit=LIMIT)
    yield from cases_of("wall", worn_wall(1.0), 1e-3, 0.02, 1.5 / (2.0 * np.pi), marches, wear=1e-7, settings=fixed)
    dovetail = scene("dovetail_sector", 13, mesh=1)
    yield from cases_of("dovetail", dovetail, 0.5, 0.5, 212.5, (("adaptive", 1.0, 1e5),))


def full_cases() -> Iterator[Case]:
    """Also sweeps over folds, ramps, random scenes that lift, hit and ratchet, a dovetail in long steps."""
    yield from quick_cases()
    impact = scene("vibro_impact")
    for sweep in ("up", "down", "ramp"):
        yield from cases_of(f"vibro-impact {sweep}", impact, 0.0, 0.02, 0.2, (), sweep=sweep)
    for seed in range(12):
        one = random_scene(seed)
        marches = ((one.scheme, one.step, one.cycles),)
        yield from cases_of(
            f"scene {seed}", one.model, one.friction, one.amplitude, one.frequency_hz, marches, one.wear_coefficient
        )
    dovetail = scene("dovetail_sector", 13, mesh=1)
    marches = (("explicit", 2000.0, 1e5), ("implicit", 2000.0, 1e5))
    yield from cases_of("dovetail 213 Hz", dovetail, 0.5, 0.5, 213.0, marches)


def perturbed(value: Any, factor: float) -> Any:
    """Half of a value, or twice as much; the value itself where there is no such thing."""
    if isinstance(value, bool):
        return value
    if isinstance(value, int):
        return max(1, int(value * factor))
    if isinstance(value, float):
        return value * factor
    if isinstance(value, tuple) and all(isinstance(item, float) for item in value):
        return tuple(item * factor for item in value)
    return value


@contextmanager
def changed(options: Any, name: str, value: Any) -> Iterator[None]:
    """With another value of a field."""
    before = getattr(options, name)
    object.__setattr__(options, name, value)
    try:
        yield
    finally:
        object.__setattr__(options, name, before)


@contextmanager
def noted_reads(options: Any, read: set[str]) -> Iterator[None]:
    """Note the fields that are read."""
    plain = type(options)
    known = {entry.name for entry in fields(plain)}

    class Noted(plain):
        def __getattribute__(self, name: str) -> Any:
            if name in known:
                read.add(name)
            return super().__getattribute__(name)

    object.__setattr__(options, "__class__", Noted)
    try:
        yield
    finally:
        object.__setattr__(options, "__class__", plain)


def reads_of(case: Case, options: dict[str, Any]) -> dict[str, set[str]]:
    """Fields of each instance that a case reads."""
    case.run()  # what marches start from is found, and kernels are compiled
    reads: dict[str, set[str]] = {name: set() for name in options}
    managers = [noted_reads(instance, reads[name]) for name, instance in options.items()]
    for manager in managers:
        manager.__enter__()
    try:
        case.run()
    finally:
        for manager in managers:
            manager.__exit__(None, None, None)
    return reads


def relative(one: float, other: float) -> float:
    """Change of a number; inf where only one of them is finite."""
    if np.isfinite(one) != np.isfinite(other):
        return np.inf
    return abs(other - one) / abs(one) if np.isfinite(one) and one != 0.0 else 0.0


def row(label: str, pairs: list[tuple[Case, Found, Found]]) -> tuple[str, bool]:
    """What a change has changed in the cases that read the field; whether anything."""
    differ = [(case, usual, now) for case, usual, now in pairs if usual.digest != now.digest]
    value = max((relative(usual.value, now.value) for _, usual, now in differ), default=0.0)
    error = max((relative(usual.error, now.error) for _, usual, now in differ), default=0.0)
    iterations = sum(now.iterations for *_, now in pairs) / max(1, sum(usual.iterations for _, usual, _ in pairs))
    seconds = sum(now.seconds for *_, now in pairs) / sum(usual.seconds for _, usual, _ in pairs)
    outcomes = [
        f"{c.name}: {usual.outcome} -> {now.outcome}" for c, usual, now in pairs if usual.outcome != now.outcome
    ]
    line = f"{label:<60} {len(differ):2d}/{len(pairs):<2d} {value:9.1e} {error:9.1e} {iterations:6.2f} {seconds:6.2f}"
    return "  ".join([line, *outcomes]), bool(differ)


def main() -> None:
    """Everything that is asked for."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--cases", choices=("quick", "full"), default="quick")
    parser.add_argument("--options", nargs="*", help="names of option instances, e.g. ACCURACY; all where not given")
    parser.add_argument("--fields", nargs="*", help="names of fields; all where not given")
    parser.add_argument("--only", default="", help="pattern in the names of the cases that are run")
    given = parser.parse_args()
    options = {name: one for name, one in all_options().items() if not given.options or name in given.options}
    cases = [
        case for case in (quick_cases if given.cases == "quick" else full_cases)() if re.search(given.only, case.name)
    ]
    usual, reads = {}, {}
    for case in cases:
        reads[case.name] = reads_of(case, options)
        usual[case.name] = one = case.run()
        numbers = f"{one.value:.4e} {one.error:.1e} {one.iterations:5d} {one.seconds:.1f} s"
        print(f"{case.name:<30} {one.outcome:<12} {numbers}", flush=True)
    print(f"\n{'field':<60} cases    volume     error  iter.   time  outcomes that change", flush=True)
    without: list[str] = []
    unread: list[str] = []
    n_fields = 0
    for room, instance in options.items():
        for entry in fields(instance):
            if given.fields and entry.name not in given.fields:
                continue
            n_fields += 1
            readers = [case for case in cases if entry.name in reads[case.name][room]]
            if not readers:
                unread.append(f"{room}.{entry.name}")
                continue
            value, effect = getattr(instance, entry.name), False
            for factor in FACTORS:
                other = perturbed(value, factor)
                if other == value:
                    continue
                with changed(instance, entry.name, other):
                    pairs = [(case, usual[case.name], case.run()) for case in readers]
                line, differs = row(f"{room}.{entry.name} {value} -> {other}", pairs)
                effect |= differs
                print(line, flush=True)
            if not effect:
                without.append(f"{room}.{entry.name}")
    print(f"\n{n_fields} fields. Read by none of the cases: {', '.join(unread) or 'none'}")
    print(f"Read, but without effect: {', '.join(without) or 'none'}")


if __name__ == "__main__":
    main()
