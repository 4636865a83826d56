"""Text of `--plan`: tasks, shared histories with reasons, estimated time and memory."""

from __future__ import annotations

import math

from studyrunner.coordinates import SCENE
from studyrunner.plan.estimate import (
    ADAPTIVE_STEPS,
    AUTOMATIC_HARMONICS,
    COMPILE_SECONDS,
    ITERATIONS_A_MODE_POINT,
    ITERATIONS_A_STEP,
    ITERATIONS_AN_ADAPTIVE_STEP,
    ITERATIONS_OF_MODE,
    ITERATIONS_TO_A_FINAL_STATE,
    memory_a_rank,
    missions_flown,
    seconds_an_iteration,
)
from studyrunner.plan.tasks import TaskPlan
from studyrunner.scene.scene import SceneFacts
from studyrunner.scene.variables import loop_numbers
from studyrunner.study.mission import MissionBlock
from studyrunner.study.sections import AUTO
from studyrunner.study.study import Study
from studyrunner.system.progress import count, format_seconds
from studyrunner.user_error import show_text

_TASKS_A_RANK = 32
"""Tasks with which a rank is busy for 95 % of a run, where their times are not known before: with 8 it is for 87 %
(`tests.benchmarks.scheduling`)."""


def format_plan(
    study: Study, facts: SceneFacts, plan: TaskPlan, built_with: float, prepared_in: float = 0.0, scenes: str = ""
) -> str:
    """The plan of a study in lines.

    facts: of the scene with the most pairs. built_with: memory for building a scene, bytes.
    prepared_in: CPU time from the start of the process until the scenes are built, s; a run needs this time, too.
    scenes: what there is to say of several scenes.
    """
    marches = [task for line in plan.marches for task in line]
    n_tasks = sum(bool(branch.frequencies) for branch in plan.branches) + (0 if study.has_modes else len(marches))
    n_values = _result_values(study, facts, plan.n_points)
    shape = " x ".join(f"{len(values)} {name}" for name, values in study.dimensions.items() if len(values) > 1)
    contact = f"{count(len(facts.area), 'contact pair')} with {facts.n_displacements} relative displacements"
    left_out = [f"{count(item.n_points, 'point')}: {item.reason}" for item in plan.left_out] or [
        "nothing" if study.solver.shortcuts else "nothing: solver.shortcuts = false"
    ]
    size = n_values * 8 / 1e6
    memory = memory_a_rank(plan.n_unknowns, n_values, AUTO in study.harmonics, built_with) / 1e9
    rows = [
        ("study", f"{study.study.name}: {study.study.title}".rstrip(": ")),
        ("scene", f"{study.scene.model}: {contact}, {count(len(facts.response_names), 'response')}"),
        *([("scenes", scenes)] if scenes else []),
        ("points", f"{plan.n_points}" + (f" = {shape}" if shape else "")),
        *([("frequency", _followed(study))] if study.follow is not None else []),
        *_slow_time(study),
        ("tasks", f"{n_tasks}: {_ways(study, plan)}"),
        *([("serial", _SERIAL)] if study.has_missions else []),
        ("solver", _solver(study, facts)),
        ("unknowns", f"{plan.n_unknowns} at most in one task" + _if_automatic(study)),
        *zip(("left out", *[""] * (len(left_out) - 1)), left_out, strict=True),
        *_time(study, plan, prepared_in),
        *([] if study.has_modes else [("ranks", _ranks(plan, n_tasks))]),
        ("assumed", _assumed(study, plan)),
        ("memory", f"about {memory:.1f} GB a rank; result {size:.1f} MB before compression"),
    ]
    return "\n".join(f"{label:<10} {' '.join(show_text(text).split())}" for label, text in rows)


_SERIAL = (
    "one rank computes all of a history, one part after the other: its missions, their blocks, the frequencies of a"
    " passage, then the reference solution"
)


def _followed(study: Study) -> str:
    assert study.follow is not None
    what = f"{study.follow.of}, found between {study.follow.low:g} and {study.follow.high:g} Hz by the sweep"
    return what if study.cycles_kept[-1] == 0.0 else f"{what} and followed while the joint wears"


def _ways(study: Study, plan: TaskPlan) -> str:
    """The tasks in words."""
    if study.has_modes:
        return f"{count(len(plan.branches), 'nonlinear mode')} over the amplitude"
    if study.has_missions:
        n_histories = len(plan.marches[0])
        beside = ", side by side on the ranks" if n_histories > 1 else ""
        return count(n_histories, "mission history", "mission histories") + beside
    n_ramps = sum(branch.sweep == "ramp" for branch in plan.branches)
    n_along = len(plan.branches) - n_ramps
    ways = [f"{count(n_along, 'branch', 'branches')} along the frequency"] if n_along else []
    ways += [f"{count(n_ramps, 'ramp')} of the excitation"] if n_ramps else []
    n_marches = sum(len(line) for line in plan.marches)
    return f"{' and '.join(ways)}, then {count(n_marches, 'wear history', 'wear histories')}"


def _time(study: Study, plan: TaskPlan, prepared_in: float) -> list[tuple[str, str]]:
    """Lines on the estimated time."""
    about = _about(plan, prepared_in)
    if study.has_modes:
        return [("time", f"{about}, to a factor of three; a mode that is lost at a large amplitude takes longer")]
    if study.has_missions:
        return [("time", f"{about}, to a factor of three, if every block wears")]
    return [("time", f"{about}, to a factor of two, if every point wears;"), ("", _range(plan))]


def _slow_time(study: Study) -> list[tuple[str, str]]:
    """Lines on cycles or missions; none of nonlinear modes."""
    if study.has_modes:
        return []
    if not study.has_missions:
        return [("cycles", _cycles(study))]
    kept = count(len(study.missions_kept), "number is", "numbers are")
    lines = [("missions", f"{study.slow_time.missions}, of which {kept} kept")]
    for block, of_block in zip(study.mission, study.block_studies, strict=True):
        lines.append(("block", f"{block.name}: {_block(block, max(of_block.axes.frequency))}"))
    return lines


def _block(block: MissionBlock, frequency: float) -> str:
    """A block in words. frequency: of steady vibration, Hz; the largest of an axis."""
    how = {"ramp": "begins with a ramp", "sweep": "begins with a sweep", "continue": "continues the block before"}
    cycles = f"{block.cycles_at(frequency):.4g} cycles a mission"
    if isinstance(block.frequency, dict):
        passed = "{start:g} to {stop:g} Hz at {rate:g} Hz/s".format(**block.frequency)
        return f"passage from {passed}, {cycles}"
    return f"{frequency:g} Hz, {cycles}, {how[block.begin]}"


def _cycles(study: Study) -> str:
    if study.to_the_end:
        kept = f"{len(study.cycles_kept)} states are kept, spaced evenly in worn volume and cycles"
        return f"until the wear rate of every pair is below {study.slow_time.final_share:g} of its largest; {kept}"
    return f"{study.cycles_kept[-1]:g}, of which {count(len(study.cycles_kept), 'count is', 'counts are')} kept"


def _assumed(study: Study, plan: TaskPlan) -> str:
    """Assumptions of the estimated time."""
    milliseconds = 1e3 * seconds_an_iteration(plan.n_unknowns)
    if study.has_modes:
        iterations = f"{ITERATIONS_A_MODE_POINT} Newton iterations of {milliseconds:.0f} ms or less a point"
        return f"{iterations}, {ITERATIONS_OF_MODE} to the first; a first run compiles for {COMPILE_SECONDS} s more"
    if study.has_missions:
        flown = missions_flown(study.cycles_kept[-1])
        at_once = f"{count(flown, 'mission is', 'missions are')} flown, and again for their reference solution"
        return f"{at_once}; Newton iterations of {milliseconds:.0f} ms or less; none where nothing slips"
    said = f"{ITERATIONS_A_STEP} Newton iterations of {milliseconds:.0f} ms or less a step"
    if "final" in study.axes.scheme:
        said += f", final {ITERATIONS_TO_A_FINAL_STATE} in all where it needs no march"
    if "adaptive" in study.axes.scheme:
        said += f", adaptive {ADAPTIVE_STEPS} steps of {ITERATIONS_AN_ADAPTIVE_STEP}"
    return f"{said}, none where nothing slips; a first run compiles for {COMPILE_SECONDS} s more"


def _solver(study: Study, facts: SceneFacts) -> str:
    """Settings of the solver, and the largest number of automatic harmonics in this scene."""
    values = {"harmonics": study.harmonics, "samples": study.samples, "tolerance": study.tolerance}
    if study.has_modes or AUTO in (*study.harmonics, *study.samples) or {"adaptive", "final"} & set(study.axes.scheme):
        values["rtol"] = study.rtol
    shown = [f"{key} {' or '.join(map(_setting, items))}" for key, items in values.items()]
    if AUTO in study.harmonics and facts.largest_harmonics is not None:
        shown[0] += f" (at most {facts.largest_harmonics}, for which the scene holds the nodal diameters)"
    return ", ".join(shown)


def _setting(value: float | str) -> str:
    return "automatic" if value == AUTO else f"{value:g}"


def _if_automatic(study: Study) -> str:
    return f", with {AUTOMATIC_HARMONICS} for automatic harmonics" if AUTO in study.harmonics else ""


def _range(plan: TaskPlan) -> str:
    """What makes the time uncertain: how many points wear, and how often the joint jumps."""
    starts = format_seconds(sum(branch.cost for branch in plan.branches))
    return (
        f"{starts} of it for the start states; points at which all pairs stick cost nothing, a point whose vibration"
        " jumps up to five times as much"
    )


def _about(plan: TaskPlan, prepared_in: float) -> str:
    """Estimated time on one rank and on two; a branch and a history from it cannot be computed at the same time."""
    one, two = (format_seconds(prepared_in + seconds) for seconds in (plan.cost, max(plan.longest, plan.cost / 2.0)))
    return f"about {one} on one rank, {two} on two"


def _ranks(plan: TaskPlan, n_tasks: int) -> str:
    """What limits the use of many ranks."""
    least = f"at least {format_seconds(plan.longest)}"
    if plan.marches[0][0].blocks:
        return (
            f"{count(n_tasks, 'rank has', 'ranks have')} work at most, one for each history; {least}, the longest one"
        )
    busy = n_tasks // _TASKS_A_RANK
    many = f"up to about {busy} ranks are" if busy > 1 else "one rank is"
    return f"{many} efficient, with {_TASKS_A_RANK} tasks each; {least}, as a history follows its start state"


def _result_values(study: Study, facts: SceneFacts, n_points: int) -> int:
    """Number of values in the result, without coordinates, natural frequencies and mesh."""
    own = {"contact": len(facts.area), "response": len(facts.response_names)}
    sizes = {"cycle": len(study.cycles_kept), **study.sizes, **own}
    names = study.outputs.variables
    asked = [entry for name, entry in study.variables.items() if name in names]
    asked.extend(SCENE["exact"].values() if "exact" in names else ())
    each = sum(math.prod(sizes[name] for name in entry.dimensions) for entry in asked)
    return n_points * (len(study.kept) + each + loop_numbers(study))
