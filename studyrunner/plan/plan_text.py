"""Text of `--plan`: tasks, results that points share with reasons, estimated time and memory."""

from __future__ import annotations

import math

from studyrunner.coordinates import SCENE
from studyrunner.kinds.estimate import AUTOMATIC_HARMONICS, COMPILE_SECONDS, memory_a_rank
from studyrunner.kinds.kind import kind_of
from studyrunner.kinds.task_plan import TaskPlan
from studyrunner.scene.scene import SceneFacts
from studyrunner.scene.variables import loop_numbers
from studyrunner.study.sections import AUTO
from studyrunner.study.study import Study
from studyrunner.system.progress import count, format_seconds
from studyrunner.user_error import show_text


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
    left_out = [f"{count(item.n_points, 'point')}: {item.reason}" for item in plan.left_out] or [nothing]
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
    values = {
        "harmonics": study.harmonics,
        "samples": study.samples,
        "tolerance": study.tolerance,
        "rtol": study.rtol,
    }
    shown = [
        f"{key} {' or '.join('automatic' if value == AUTO else f'{value:g}' for value in items)}"
        for key, items in values.items()
    ]
    if AUTO in study.harmonics and facts.largest_harmonics is not None:
        shown[0] += f" (at most {facts.largest_harmonics}, for which the scene holds the nodal diameters)"
    return ", ".join(shown)


def _result_values(study: Study, facts: SceneFacts, n_points: int) -> int:
    """Number of values in the result, without coordinates, natural frequencies and mesh."""
    own = {"contact": len(facts.area), "response": len(facts.response_names)}
    sizes = {"cycle": len(study.cycles_kept), **study.sizes, **own}
    names = study.outputs.variables
    asked = [entry for name, entry in study.variables.items() if name in names]
    asked.extend(SCENE["exact"].values() if "exact" in names else ())
    each = sum(math.prod(sizes[name] for name in entry.dimensions) for entry in asked)
    return n_points * (len(study.kept) + each + loop_numbers(study))
