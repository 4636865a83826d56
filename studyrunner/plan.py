"""What `--plan` says of a study: tasks, what points share and why, time and memory, and what is hardly meant."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from studyrunner.kinds.estimate import AUTOMATIC_HARMONICS, COMPILE_SECONDS, memory_a_rank
from studyrunner.kinds.kind import describe_tasks
from studyrunner.kinds.task import TaskPlan
from studyrunner.scene.scene import SceneFacts, values_of_point
from studyrunner.study.sections import AUTO, SOLVER_AXES
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
    tasks, n_values = (*plan.sweeps, *plan.results), plan.n_points * values_of_point(study, facts)
    shape = " x ".join(f"{len(values)} {name}" for name, values in study.dimensions.items() if len(values) > 1)
    contact = f"{count(len(facts.area), 'contact pair')} with {facts.n_displacements} relative displacements"
    nothing = "nothing" if study.solver.shortcuts else "nothing: solver.shortcuts = false"
    left_out = [f"{count(number, 'point')}: {reason}" for reason, number in plan.left_out.items()] or [nothing]
    n_unknowns, is_automatic = max(task.n_unknowns for task in plan.results), AUTO in study.solver.harmonics
    memory = memory_a_rank(n_unknowns, n_values, is_automatic, built_with) / 1e9
    automatic = f", with {AUTOMATIC_HARMONICS} for automatic harmonics" if is_automatic else ""
    # a history with the sweep that it waits for
    sweeps = {sweep.number: sweep.cost for sweep in plan.sweeps}
    longest = max(task.cost + (sweeps[task.waits_for[0]] if task.waits_for else 0.0) for task in plan.results)
    one, two, most = (
        format_seconds(prepared_in + seconds) for seconds in (plan.cost, max(longest, plan.cost / 2.0), longest)
    )
    rows = [
        ("study", f"{study.study.name}: {study.study.title}".rstrip(": ")),
        ("scene", f"{study.scene.model}: {contact}, {count(len(facts.response_names), 'response')}"),
        *([("scenes", scenes)] if scenes else []),
        ("points", f"{plan.n_points}" + (f" = {shape}" if shape else "")),
        *([("frequency", _followed(study))] if study.follow is not None else []),
        *(_slow_time(study) if study.kind.counted else []),
        ("tasks", f"{len(tasks)}: {describe_tasks(tasks)}"),
        ("solver", _solver(study, facts)),
        ("unknowns", f"{n_unknowns} at most in one task{automatic}"),
        *zip(("left out", *[""] * (len(left_out) - 1)), left_out, strict=True),
        ("time", f"about {one} on one rank, {two} on two, {most} on many, {study.kind.time}"),
        ("", f"points at which all pairs stick take next to none; a first run compiles for {COMPILE_SECONDS} s more"),
        ("memory", f"about {memory:.1f} GB a rank; result {n_values * 8 / 1e6:.1f} MB before compression"),
    ]
    return "\n".join(f"{label:<10} {' '.join(show_text(text).split())}" for label, text in rows)


def _followed(study: Study) -> str:
    assert study.follow is not None
    what = f"{study.follow.of}, found between {study.follow.low:g} and {study.follow.high:g} Hz by the sweep"
    return what if study.output_counts[-1] == 0.0 else f"{what} and followed while the joint wears"


def _slow_time(study: Study) -> Iterator[tuple[str, str]]:
    n_kept = len(study.output_counts)
    if study.mission:
        yield "missions", f"{study.slow_time.missions}, of which {count(n_kept, 'number is', 'numbers are')} kept"
        for block, own in zip(study.mission, study.block_studies, strict=True):
            yield "block", f"{block.name}: {block.describe(max(own.axes.frequency))}"
    elif study.to_the_end:
        until = f"until the wear rate of every pair is below {study.slow_time.final_share:g} of its largest"
        yield "cycles", f"{until}; {n_kept} states are kept, spaced evenly in worn volume and cycles"
    else:
        yield "cycles", f"{study.output_counts[-1]:g}, of which {count(n_kept, 'count is', 'counts are')} kept"


def _solver(study: Study, facts: SceneFacts) -> str:
    """Settings of the solver, and the largest number of automatic harmonics in this scene."""
    shown = [
        f"{key} {' or '.join('automatic' if value == AUTO else f'{value:g}' for value in getattr(study.solver, key))}"
        for key in SOLVER_AXES
    ]
    if AUTO in study.solver.harmonics and facts.largest_harmonics is not None:
        shown[0] += f" (at most {facts.largest_harmonics}, for which the scene holds the nodal diameters)"
    return ", ".join(shown)


def doubts_of_study(study: Study, facts: SceneFacts | None = None) -> tuple[str, ...]:
    """A question for each key with values far off, as a unit that was mixed up: the value farthest off speaks for all.

    Never a refusal. facts: of the scene, where it is built.
    """
    parts = [part for variant in study.variants or (study,) for part in (variant, *variant.block_studies)]
    found = [*_on_wear(study), *_on_depths(study, parts)]
    amplitude = max(value for part in parts for value in part.axes.excitation_amplitude)
    if amplitude > _LARGEST_AMPLITUDE:
        what = f"excitation_amplitude {amplitude:.3g} N is more than joints of machines carry"
        found.append(_in_units(what, "N", {"mN": 1e-3, "uN": 1e-6}, (1e-3, _LARGEST_AMPLITUDE), amplitude))
    friction = max(_numbers(parts, "friction_coefficient"), default=0.0)
    if friction > _LARGEST_FRICTION:
        what = f"friction_coefficient {friction:.3g} is more than dry metals have, 0.1 to 1.5"
        asked = f"is it in percent (then it is {friction / 100.0:.3g})" if friction >= 5.0 else "is it meant"
        found.append(f"{what}: {asked}?")
    speed = min((speed for speed in _numbers(parts, "rotation_speed") if speed > 0.0), default=_SLOWEST)
    if speed < _SLOWEST:
        units = {"rad/s": 30.0 / math.pi, "revolutions per second": 60.0}
        found.append(_in_units(f"rotation_speed {speed:.4g} rpm is slow", "rpm", units, (0.0, math.inf), speed))
    return (*found, *_on_frequencies(study, parts, math.nan if facts is None else facts.stuck_frequency))


def _in_units(what: str, unit: str, factors: dict[str, float], plausible: tuple[float, float], value: float) -> str:
    """A question: `what`, and in which unit the value would be plausible. factors: of `unit`, by name of the unit."""
    units = [
        f"in {name} (then it is {value * factor:.5g} {unit})"
        for name, factor in factors.items()
        if plausible[0] <= value * factor <= plausible[1]
    ]
    return f"{what}: is it {' or '.join(units) or 'meant'}?"


def _on_wear(study: Study) -> Iterator[str]:
    table, coefficients = study.wear.as_law.table, study.axes.wear_coefficient
    factors = [1.0] if table is None else [factor for row in table.factor for factor in row if factor > 0.0]
    values = [value * factor for value in coefficients if value > 0.0 for factor in factors]
    off = [value for value in values if not _PLAUSIBLE[0] <= value <= _PLAUSIBLE[1]]
    if off:
        worst = max(off, key=lambda value: abs(math.log(value / _OF_THE_PAPER)))
        what = "wear_coefficient" if table is None else "wear_coefficient times wear.factor"
        larger = worst > _OF_THE_PAPER
        times = f"{worst / _OF_THE_PAPER:.1g} times larger" if larger else f"{_OF_THE_PAPER / worst:.1g} times smaller"
        units = {"1/MPa or mm2/N": 1e-6, "mm3/(N m) or mm3/J": 1e-9} if larger else {}
        text = f"{what} {worst:.3g} 1/Pa is {times} than the default, {_OF_THE_PAPER:g} 1/Pa"
        yield _in_units(text, "1/Pa", units, _PLAUSIBLE, worst)


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


def _on_frequencies(study: Study, parts: Sequence[Study], stuck: float) -> Iterator[str]:
    """stuck: first natural frequency with the joint stuck, Hz."""
    if not study.kind.counted or study.axes.frequency_ratio or not 0.0 < stuck < math.inf:
        return
    own = [value for part in parts if not (study.mission and part.mission) for value in part.axes.frequency]
    passages = [block.frequency for block in study.mission if isinstance(block.frequency, dict)]
    own += [passage[end] for passage in passages for end in ("start", "stop")]
    near, plausible = f"that of the first resonance, near {stuck:.4g} Hz", (stuck / _FAR, stuck * _FAR)
    if max(own) < plausible[0]:
        what = f"frequency {max(own):.4g} Hz, the highest, is 1/{stuck / max(own):.0f} of {near}"
        yield _in_units(what, "Hz", {"kHz": 1e3}, plausible, max(own))
    if min(own) > plausible[1]:
        what = f"frequency {min(own):.4g} Hz, the lowest, is {min(own) / stuck:.0f} times {near}"
        yield _in_units(what, "Hz", {"mHz": 1e-3}, plausible, min(own))


def _numbers(parts: Sequence[Study], name: str) -> list[float]:
    values = [dict(each.scene.parameters).get(name) for each in parts]
    values += [each for value in values if isinstance(value, dict) for each in value.values()]
    return [float(value) for value in values if isinstance(value, int | float)]
