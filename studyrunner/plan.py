"""What `--plan` says of a study: tasks, what points share and why, time and memory, and what is hardly meant."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from studyrunner.coordinates import SCENE
from studyrunner.kinds.estimate import AUTOMATIC_HARMONICS, COMPILE_SECONDS, memory_a_rank
from studyrunner.kinds.kind import kind_of
from studyrunner.kinds.task import TaskPlan
from studyrunner.scene.scene import SceneFacts, loop_numbers
from studyrunner.study.sections import AUTO
from studyrunner.study.study import Study
from studyrunner.system.progress import count, format_seconds
from studyrunner.user_error import show_text

_OF_THE_PAPER = 1.1e-11
"""The default, 1/Pa, which is that of the reference."""

_PLAUSIBLE = (1.9e-17, 4e-10)
"""Wear coefficients, 1/Pa, that are not asked about: a factor of 1000 around what was measured of metals, 1.9e-14
(steel; McColl, Ding and Leen, Wear 256 (2004) 1114) to 4e-13 (Ti-6Al-4V, 4e-4 mm3/J), as studies wear faster than
machines. Energy coefficients are Archard's over the friction coefficient, which is little beside this factor."""

_LARGEST_FRICTION = 2.0
"""Coulomb friction coefficients that are not asked about: dry metals in air stay below 1.5."""

_SLOWEST = 1000.0
"""rpm; rotation speeds below it are asked about: machines whose blades wear turn faster, and 314 rad/s is 3000 rpm."""

_FAR = 30.0
"""Frequencies of an excitation are asked about from this ratio on, below the first resonance and above: the first six
natural frequencies of a bundled sector are within 10."""

_DEEPEST = 1e-3
"""m; wear depths above it are asked about: scars of fretting are some hundred um deep at most."""

_LARGEST_AMPLITUDE = 1e6
"""N; excitation amplitudes above it are asked about: a blade root of 280 mm2 carries 1e5 N."""


def format_plan(
    study: Study, facts: SceneFacts, plan: TaskPlan, built_with: float, prepared_in: float = 0.0, scenes: str = ""
) -> str:
    """The plan of a study in lines.

    facts: of the scene with the most pairs. built_with: memory for building a scene, bytes.
    prepared_in: CPU time from the start of the process until the scenes are built, s; a run needs this time, too.
    scenes: what there is to say of several scenes.
    """
    kind, tasks = kind_of(study), (*plan.sweeps, *plan.results)
    n_values = _result_values(study, facts, plan.n_points)
    shape = " x ".join(f"{len(values)} {name}" for name, values in study.dimensions.items() if len(values) > 1)
    contact = f"{count(len(facts.area), 'contact pair')} with {facts.n_displacements} relative displacements"
    nothing = "nothing" if study.solver.shortcuts else "nothing: solver.shortcuts = false"
    left_out = [f"{count(number, 'point')}: {reason}" for reason, number in plan.left_out.items()] or [nothing]
    memory = memory_a_rank(plan.n_unknowns, n_values, AUTO in study.harmonics, built_with) / 1e9
    automatic = f", with {AUTOMATIC_HARMONICS} for automatic harmonics" if AUTO in study.harmonics else ""
    one, two, most = (
        format_seconds(prepared_in + seconds)
        for seconds in (plan.cost, max(plan.longest, plan.cost / 2.0), plan.longest)
    )
    rows = [
        ("study", f"{study.study.name}: {study.study.title}".rstrip(": ")),
        ("scene", f"{study.scene.model}: {contact}, {count(len(facts.response_names), 'response')}"),
        *([("scenes", scenes)] if scenes else []),
        ("points", f"{plan.n_points}" + (f" = {shape}" if shape else "")),
        *([("frequency", _followed(study))] if study.follow is not None else []),
        *kind.slow_time(study),
        ("tasks", f"{len(tasks)}: {kind.describe_tasks(tasks)}"),
        ("solver", _solver(study, facts)),
        ("unknowns", f"{plan.n_unknowns} at most in one task{automatic}"),
        *zip(("left out", *[""] * (len(left_out) - 1)), left_out, strict=True),
        ("time", f"about {one} on one rank, {two} on two, {most} on many, {kind.TIME}"),
        ("", f"points at which all pairs stick take next to none; a first run compiles for {COMPILE_SECONDS} s more"),
        ("memory", f"about {memory:.1f} GB a rank; result {n_values * 8 / 1e6:.1f} MB before compression"),
    ]
    return "\n".join(f"{label:<10} {' '.join(show_text(text).split())}" for label, text in rows)


def _followed(study: Study) -> str:
    assert study.follow is not None
    what = f"{study.follow.of}, found between {study.follow.low:g} and {study.follow.high:g} Hz by the sweep"
    return what if study.cycles_kept[-1] == 0.0 else f"{what} and followed while the joint wears"


def _solver(study: Study, facts: SceneFacts) -> str:
    """Settings of the solver, and the largest number of automatic harmonics in this scene."""
    shown = [
        f"{key} {' or '.join('automatic' if value == AUTO else f'{value:g}' for value in getattr(study, key))}"
        for key in ("harmonics", "samples", "tolerance", "rtol")
    ]
    if AUTO in study.harmonics and facts.largest_harmonics is not None:
        shown[0] += f" (at most {facts.largest_harmonics}, for which the scene holds the nodal diameters)"
    return ", ".join(shown)


def _result_values(study: Study, facts: SceneFacts, n_points: int) -> int:
    """Number of values in the result, without coordinates, natural frequencies and mesh."""
    own = {"contact": len(facts.area), "response": len(facts.response_names)}
    sizes = {"cycle": len(study.cycles_kept), **study.sizes, **own}
    names = study.outputs.variables
    asked = [entry for name, entry in study.kind.asked.items() if name in names]
    asked.extend(SCENE["exact"].values() if "exact" in names else ())
    each = sum(math.prod(sizes[name] for name in entry.dimensions) for entry in asked)
    return n_points * (len(study.kind.kept) + each + loop_numbers(study))


def doubts_of_study(study: Study, facts: SceneFacts | None = None) -> tuple[str, ...]:
    """A question for each key with values far off, as a unit that was mixed up: the value farthest off speaks for all.

    Never a refusal. facts: of the scene, where it is built.
    """
    parts = [part for variant in study.variants or (study,) for part in (variant, *variant.block_studies)]
    found = [_on_wear(study), *_on_depths(study, parts), _on_amplitude(parts)]
    found += [_on_friction(parts), _on_speed(parts), _on_frequencies(study, parts, facts)]
    return tuple(line for line in found if line)


def _in_units(what: str, unit: str, factors: dict[str, float], plausible: tuple[float, float], value: float) -> str:
    """A question: `what`, and in which unit the value would be plausible. factors: of `unit`, by name of the unit."""
    units = [
        f"in {name} (then it is {value * factor:.5g} {unit})"
        for name, factor in factors.items()
        if plausible[0] <= value * factor <= plausible[1]
    ]
    return f"{what}: is it {' or '.join(units) or 'meant'}?"


def _on_wear(study: Study) -> str:
    table, coefficients = study.wear_law.table, study.axes.wear_coefficient
    factors = [1.0] if table is None else [factor for row in table.factor for factor in row if factor > 0.0]
    values = [value * factor for value in coefficients if value > 0.0 for factor in factors]
    off = [value for value in values if not _PLAUSIBLE[0] <= value <= _PLAUSIBLE[1]]
    if not off:
        return ""
    worst = max(off, key=lambda value: abs(math.log(value / _OF_THE_PAPER)))
    what = "wear_coefficient" if table is None else "wear_coefficient times wear.factor"
    times, side = (worst / _OF_THE_PAPER, "larger") if worst > _OF_THE_PAPER else (_OF_THE_PAPER / worst, "smaller")
    text = f"{what} {worst:.3g} 1/Pa is {times:.1g} times {side} than the default, {_OF_THE_PAPER:g} 1/Pa"
    units = {"1/MPa or mm2/N": 1e-6, "mm3/(N m) or mm3/J": 1e-9} if worst > _OF_THE_PAPER else {}
    return _in_units(text, "1/Pa", units, _PLAUSIBLE, worst)


def _on_depths(study: Study, parts: Sequence[Study]) -> Iterator[str]:
    worn = [depth for part in parts if part.scene.worn for state in part.scene.worn.depth for depth in state]
    until = (study.slow_time.until or {}).get("wear_depth", 0.0)
    for key, value in (
        ("scene.worn", max(worn, default=0.0)),
        ("slow_time.until.wear_depth", until),
        ("slow_time.largest_depth", study.slow_time.largest_depth or 0.0),
    ):
        if value > _DEEPEST:
            what = f"{key} {value:.3g} m is deeper than joints wear, which is below 1 mm"
            yield _in_units(what, "m", {"mm": 1e-3, "um": 1e-6}, (1e-9, _DEEPEST), value)


def _on_amplitude(parts: Sequence[Study]) -> str:
    largest = max(value for part in parts for value in part.axes.excitation_amplitude)
    if largest <= _LARGEST_AMPLITUDE:
        return ""
    what = f"excitation_amplitude {largest:.3g} N is more than joints of machines carry"
    return _in_units(what, "N", {"mN": 1e-3, "uN": 1e-6}, (1e-3, _LARGEST_AMPLITUDE), largest)


def _on_friction(parts: Sequence[Study]) -> str:
    largest = max(_numbers(parts, "friction_coefficient"), default=0.0)
    if largest <= _LARGEST_FRICTION:
        return ""
    what = f"friction_coefficient {largest:.3g} is more than dry metals have, 0.1 to 1.5"
    asked = f"is it in percent (then it is {largest / 100.0:.3g})" if largest >= 5.0 else "is it meant"
    return f"{what}: {asked}?"


def _on_speed(parts: Sequence[Study]) -> str:
    slow = [speed for speed in _numbers(parts, "rotation_speed") if 0.0 < speed < _SLOWEST]
    if not slow:
        return ""
    units = {"rad/s": 30.0 / math.pi, "revolutions per second": 60.0}
    return _in_units(f"rotation_speed {min(slow):.4g} rpm is slow", "rpm", units, (0.0, math.inf), min(slow))


def _on_frequencies(study: Study, parts: Sequence[Study], facts: SceneFacts | None) -> str:
    stuck = math.nan if facts is None else facts.stuck_frequency
    own = [value for part in parts if not (study.mission and part.mission) for value in part.axes.frequency]
    passed = [
        value
        for block in study.mission
        if isinstance(block.frequency, dict)
        for value in (block.frequency["start"], block.frequency["stop"])
    ]
    highest, lowest = max((*own, *passed)), min((*own, *passed))
    if not study.kind.counted or study.axes.frequency_ratio or not 0.0 < stuck < math.inf:
        return ""
    near = f"that of the first resonance, near {stuck:.4g} Hz"
    plausible = (stuck / _FAR, stuck * _FAR)
    if highest < plausible[0]:
        what = f"frequency {highest:.4g} Hz, the highest, is 1/{stuck / highest:.0f} of {near}"
        return _in_units(what, "Hz", {"kHz": 1e3}, plausible, highest)
    if lowest > plausible[1]:
        what = f"frequency {lowest:.4g} Hz, the lowest, is {lowest / stuck:.0f} times {near}"
        return _in_units(what, "Hz", {"mHz": 1e-3}, plausible, lowest)
    return ""


def _numbers(parts: Sequence[Study], name: str) -> list[float]:
    """Numbers under a key of [scene]."""
    values = [dict(each.scene.parameters).get(name) for each in parts]
    values += [each for value in values if isinstance(value, dict) for each in value.values()]
    return [float(value) for value in values if isinstance(value, int | float)]
