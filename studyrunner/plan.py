"""The tasks of a study, whatever its kind, what `--plan` says of them, and questions about values that are far off."""

import math
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

from solver.contact.wear_law import WearTable
from studyrunner.kinds.estimate import AUTOMATIC_HARMONICS, COMPILE_SECONDS, largest_memory, memory_a_rank
from studyrunner.kinds.task import TaskPlan, Work, with_tasks
from studyrunner.scene.scene import SceneFacts, farthest_from_default, values_of_point
from studyrunner.scene.scene_set import SceneSet, merge_facts, plan_scenes
from studyrunner.study.sections import AUTO, SOLVER_AXES
from studyrunner.study.study import Study
from studyrunner.system.progress import count, format_seconds
from studyrunner.user_error import show_text

_PLAUSIBLE_WEAR = (1.9e-17, 4e-10)
"""Wear coefficients, 1/Pa, that are not asked about: a factor of 1000 around what was measured of metals, 1.9e-14
(steel; McColl, Ding and Leen, Wear 256 (2004) 1114) to 4e-13 (Ti-6Al-4V, 4e-4 mm3/J), as studies wear faster than
machines. Energy coefficients are Archard's over the friction coefficient, which is little beside this factor."""

_UNITS_OF_WEAR = {"1/MPa or mm2/N": 1e-6, "mm3/(N m) or mm3/J": 1e-9}
_UNITS_OF_SPEED = {"rad/s": 30.0 / math.pi, "revolutions per second": 60.0}

_FAR = 30.0  # ratio to the first resonance from which a frequency is asked about: six of a sector are within 10


def build_tasks(study: Study, scenes: SceneSet, facts: Sequence[SceneFacts]) -> TaskPlan:
    """Tasks of a study. Their order and numbers depend on the study alone. facts: of each scene. Raises UserError where
    a sample draws a value that is none, or blocks of a mission differ in their pairs.
    """
    build: Callable[..., TaskPlan] = study.kind.part("tasks").build_tasks
    return build(study, with_tasks(study, scenes, facts), [each.n_displacements for each in facts])


class Effort(NamedTuple):
    """What tasks take.

    words: how many of which kind. n_tasks. n_unknowns: most of one task. seconds, longest: estimated time on one rank
    where every point wears, and of the longest task with the sweep that it waits for.
    """

    words: str
    n_tasks: int
    n_unknowns: int
    seconds: float
    longest: float


def effort_of(study: Study, works: Iterable[Work]) -> Effort:
    """What all of these take, of a study."""
    n_tasks, n_unknowns, seconds, longest = 0, 0, 0.0, 0.0
    n_of, n_results = Counter[str](), Counter[str]()
    for work in works:
        n_tasks, n_unknowns, seconds = n_tasks + work.n_tasks, max(n_unknowns, work.n_unknowns), seconds + work.seconds
        n_of[work.way] += work.n_tasks
        n_results[work.way] += work.n_results
        longest = max(longest, work.longest)
    ways: Mapping[str, Callable[[int, int], str]] = study.kind.part("tasks").WAYS
    words = ", and ".join(text(n_of[way], n_results[way]) for way, text in ways.items() if n_of[way])
    return Effort(words, n_tasks, n_unknowns, seconds, longest)


def plan_lines(study: Study, say: Callable[[str], None]) -> list[str]:
    """The plan of a study in lines. say: takes a line on the next step. Raises UserError where a scene is wrong."""
    before = largest_memory()
    scenes, facts, seconds_left = plan_scenes(study, say)
    built_with = largest_memory() - before
    plan, largest = build_tasks(study, scenes, facts), merge_facts(facts)
    seconds = time.process_time() + seconds_left
    effort = effort_of(study, plan.works)
    rows = [
        *_of_study(study, facts, plan, effort),
        *_of_effort(study, largest, plan, effort, built_with, seconds),
        *study.scene.source.remarks(),
        *(("note", doubt) for doubt in doubts_of_study(study, largest)),
    ]
    return [f"{label:<10} {' '.join(show_text(text).split())}" for label, text in rows]


def _of_study(
    study: Study, of_scenes: Sequence[SceneFacts], plan: TaskPlan, effort: Effort
) -> Iterator[tuple[str, str]]:
    facts = merge_facts(of_scenes)
    shape = " x ".join(f"{len(values)} {name}" for name, values in study.dimensions.items() if len(values) > 1)
    n_contact = facts.contact.n_contact
    contact = f"{count(n_contact, 'contact pair')} with {count(facts.n_displacements, 'relative displacement')}"
    yield "study", f"{study.study.name}: {study.study.title}".rstrip(": ")
    ring = f"ring of {facts.n_ring} sectors, " if study.scene.ring else ""
    yield "scene", f"{study.scene.model}: {ring}{contact}, {count(len(facts.response_names), 'response')}"
    if len(of_scenes) > 1:
        fewest = min(each.contact.n_contact for each in of_scenes)
        pairs = f"{fewest} to " * (fewest < n_contact) + count(n_contact, "contact pair")
        yield "scenes", f"{len(of_scenes)}, built once each, with {pairs}"
    yield "points", f"{plan.n_points}" + (f" = {shape}" if shape else "")
    if study.scatter is not None:
        from studyrunner.statistics.sentences import what_samples_tell  # a run without samples needs no xarray

        yield "samples", what_samples_tell(study.scatter)
    yield from study.kind.part("tasks").plan_rows(study)
    yield "tasks", f"{effort.n_tasks}: {effort.words}"


def _of_effort(
    study: Study, facts: SceneFacts, plan: TaskPlan, effort: Effort, built_with: float, prepared_in: float
) -> Iterator[tuple[str, str]]:
    """built_with: memory for building a scene, bytes. prepared_in: CPU time until the scenes are built, s."""
    shown = [
        f"{key} {' or '.join('automatic' if value == AUTO else f'{value:g}' for value in getattr(study.solver, key))}"
        for key in SOLVER_AXES
    ]
    is_automatic = AUTO in study.solver.harmonics
    if is_automatic and facts.largest_harmonics is not None:
        shown[0] += f" (at most {facts.largest_harmonics}, for which the scene holds the nodal diameters)"
    yield "solver", ", ".join(shown)
    automatic = f", with {AUTOMATIC_HARMONICS} for automatic harmonics" if is_automatic else ""
    yield "unknowns", f"{effort.n_unknowns} at most in one task{automatic}"
    nothing = "nothing" if study.solver.shortcuts else "nothing: solver.shortcuts = false"
    left_out = [f"{count(number, 'point')}: {reason}" for reason, number in plan.left_out.items()] or [nothing]
    yield from zip(("left out", *[""] * (len(left_out) - 1)), left_out, strict=True)
    whole, longest = effort.seconds, effort.longest
    one, two, most = (format_seconds(prepared_in + each) for each in (whole, max(longest, whole / 2.0), longest))
    longer = "; a contact that changes takes up to three times as long" if study.evolving else ""
    earlier = ", less where points end at their target" if study.slow_time.until and not study.allowable else ""
    yield "time", f"about {one} on one rank, {two} on two, {most} on many, {study.kind.time}{longer}{earlier}"
    yield "", f"points at which all pairs stick take next to none; a first run compiles for {COMPILE_SECONDS} s more"
    n_values = plan.n_points * values_of_point(study, facts)
    memory = memory_a_rank(effort.n_unknowns, n_values, is_automatic, built_with, facts.n_ring) / 1e9
    yield "memory", f"about {memory:.1f} GB a rank; result {n_values * 8 / 1e6:.1f} MB before compression"


def doubts_of_study(study: Study, facts: SceneFacts | None = None) -> tuple[str, ...]:
    """A question, never a refusal, for each key with values far off, as a unit that was mixed up: the farthest speaks
    for all. facts: of the scene, where it is built.
    """
    parts = [part for variant in study.variants or (study,) for part in (variant, *variant.block_studies)]
    table, until = study.wear.as_law.table, study.slow_time.until or {}
    limits = study.scatter.given_limits if study.scatter else {}
    factors = [factor for row in table.factor for factor in row] if isinstance(table, WearTable) else [1.0]
    wear = [value * factor for value in study.axes.wear_coefficient for factor in factors]
    of_wear = "wear_coefficient times wear.factor" if isinstance(table, WearTable) else "wear_coefficient"
    worn = [depth for part in parts if part.scene.worn for state in part.scene.worn.depth for depth in state]
    rings = [part.scene.ring for part in parts if part.scene.ring]
    worn += [depth for ring in rings for depth in ring.wear_depth]
    gap = [abs(value) for value in _numbers(parts, "gap")]
    # variants have the axes of the study
    excited = [study, *(block for variant in study.variants or (study,) for block in variant.block_studies)]
    amplitude = [value for part in excited for value in part.axes.excitation_amplitude]
    friction, speed = _numbers(parts, "friction_coefficient"), _numbers(parts, "rotation_speed")
    friction += [value for ring in rings for value in ring.friction]
    lengths, deep = {"mm": 1e-3, "um": 1e-6}, "deeper than joints wear, some hundred um"
    depth, volume = ("m", 0.0, 1e-3, lengths), ("m3", 0.0, 1e-3, {"mm3": 1e-9})
    stuck, own = 0.0 if facts is None else facts.stuck_frequency, _frequencies(study, excited)
    found = [
        _question(of_wear, wear, ("1/Pa", *_PLAUSIBLE_WEAR, _UNITS_OF_WEAR), "a thousand times off what metals have"),
        # 1600 years at 200 Hz
        _question("slow_time.cycles", [study.slow_time.cycles], ("", 0.0, 1e13, {}), "more than machines live"),
        _question("slow_time.until.wear_depth", [until.get("wear_depth", 0.0)], depth, deep),
        _question("slow_time.until.worn_volume", [until.get("worn_volume", 0.0)], volume, "more than joints lose"),
        _question("scatter.limits.wear_depth", [limits.get("wear_depth", 0.0)], depth, deep),
        _question("scatter.limits.worn_volume", [limits.get("worn_volume", 0.0)], volume, "more than joints lose"),
        _question(
            "scatter.limits.response_amplitude",
            [limits.get("response_amplitude", 0.0)],
            ("m", 0.0, 1.0, lengths),
            "more than parts vibrate",
        ),
        _question("slow_time.largest_depth", [study.slow_time.largest_depth or 0.0], depth, deep),
        _question("scene.worn", worn, depth, deep),
        _question("gap", gap, ("m", 0.0, 1.0, lengths), "wider than joints are"),
        # a blade root of 280 mm2 bears 1e5 N
        _question("excitation_amplitude", amplitude, ("N", 0.0, 1e6, {"mN": 1e-3}), "more than joints bear"),
        _question("friction_coefficient", friction, ("", 0.0, 2.0, {"percent": 0.01}), "more than dry metals have"),
        _question(
            "loss_factor", _numbers(parts, "loss_factor"), ("", 0.0, 0.5, {"percent": 0.01}), "more than metals have"
        ),
        _question(
            "wear.evolution.energy",
            study.wear.evolution.energy[-1:] if study.wear.evolution else [],
            ("J/m2", 100.0, math.inf, {"kJ/m2": 1e3, "J/mm2": 1e6}),
            "less than a joint dissipates in some cycles",
        ),
        # 314 rad/s is 3000 rpm
        _question("rotation_speed", speed, ("rpm", 1000.0, math.inf, _UNITS_OF_SPEED), "slow for a machine"),
    ]
    key, value, default = farthest_from_default(study)
    if key and not any(each.startswith(key) for each in found):
        found.append(f"scene.{key} = {value:g} is far from its default, {default:g}: is its unit meant?")
    if not study.evolving and any(each.scene.worn and each.scene.worn.energy for each in parts):
        found.append(
            "scene.worn has dissipated energies, with which friction and stiffness change by [wear.evolution], and this"
            " study has none: is that meant, or is the [wear.evolution] of the wear study to be repeated?"
        )
    found += _about_frequencies(own, stuck)
    return tuple(filter(None, found))


def _about_frequencies(own: Sequence[float], stuck: float) -> list[str]:
    """Questions for frequencies, Hz, far from the first resonance with the joint stuck, 0 where it is not known."""
    found = list[str]()
    low, high = (end(own, default=0.0) / (2.0 * math.pi) for end in (min, max))
    if stuck / math.pi < low < 2.0 * stuck and 0.5 * stuck < high:
        found.append(f"frequencies are all far above the first resonance, {stuck:.5g} Hz: are they in rad/s?")
    if own and 0.0 < stuck < math.inf:
        nearest = min(own, key=lambda frequency: abs(math.log(frequency / stuck)))
        near = ("Hz", stuck / _FAR, stuck * _FAR, {"kHz": 1e3, "mHz": 1e-3})
        found.append(_question("frequency", [nearest], near, f"far from the first resonance, near {stuck:.4g} Hz"))
    return found


def _question(
    key: str, values: Sequence[float], expected: tuple[str, float, float, Mapping[str, float]], why: str
) -> str:
    """A question for the value that is farthest off, and in which units it would be likely; "" where none is off.
    expected: unit of the key, the range that is not asked about, and factors of this unit, by name of another unit.
    """
    unit, low, high, units = expected
    off = [value for value in values if 0.0 < value < math.inf and not low <= value <= high]
    if not off:
        return ""
    worst = max(off, key=lambda value: max(value / high, low / value))
    likely = [
        f"in {name} (then it is {worst * factor:.5g} {unit}".rstrip() + ")"
        for name, factor in units.items()
        if low <= worst * factor <= high
    ]
    return f"{' '.join((key, f'{worst:.3g}', unit)).rstrip()} is {why}: is it {' or '.join(likely) or 'meant'}?"


def _frequencies(study: Study, parts: Sequence[Study]) -> list[float]:
    """Frequencies of the excitation that the study gives in Hz."""
    if not study.kind.counted or study.axes.frequency_ratio:
        return []
    own = [value for part in parts if not part.block_studies for value in part.axes.frequency]
    return own + [end for block in study.mission if block.passage for end in (block.passage.start, block.passage.stop)]


def _numbers(parts: Sequence[Study], name: str) -> list[float]:
    values = [dict(each.scene.parameters).get(name) for each in parts]
    values += [each for value in values if isinstance(value, dict) for each in value.values()]
    return [float(value) for value in values if isinstance(value, int | float)]
