"""Attributes of the variables of a result file, and all of its arrays that no task computes."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from solver.outcome import Outcome
from studyrunner.coordinates import COORDINATES, STUCK_FREQUENCY, WORN_DEPTH
from studyrunner.scene import scene_set
from studyrunner.scene.answers import SmallArray
from studyrunner.scene.scene import SceneFacts
from studyrunner.study.parts import block_of_input, draw_inputs
from studyrunner.study.scene_axes import describe_key
from studyrunner.study.study import Study
from studyrunner.variables import ASKED, LOOP_COMPONENTS, LOOP_PHASES, Variable

_NAMED = COORDINATES | {
    "gap": Variable(("contact",), "m", "initial gap of the contact pair"),
    "area": Variable(("contact",), "m2", "area of the contact pair"),
}


def attributes(name: str, entry: Variable) -> dict[str, object]:
    """Attributes of a variable of the file."""
    content = "coordinate" if name in COORDINATES else entry.content
    about: dict[str, object] = {"units": entry.units, "long_name": entry.long_name, "coverage_content_type": content}
    has_gaps = name in ASKED and "cycle" in entry.dimensions and not entry.dtype.startswith("float")
    gaps = "0 where there is no result, see last_cycle." if has_gaps else ""
    if comment := f"{entry.comment} {gaps}".strip():
        about["comment"] = comment
    if flags := [outcome.meaning for outcome in Outcome] if name == "outcome" else entry.flags:
        about["flag_values"] = np.array(list(Outcome) if name == "outcome" else range(len(flags)), dtype=entry.dtype)
        about["flag_meanings"] = " ".join(flags)
    if name == "outcome":
        about["sentences"] = "\n".join(outcome.sentence for outcome in Outcome)
    return about


def small_arrays(
    study: Study, scenes: scene_set.SceneSet, facts: Sequence[SceneFacts], of_scene: Sequence[SmallArray] = ()
) -> list[SmallArray]:
    """Coordinates of the file, and its variables that no task computes. of_scene: what the study asks of the scene."""
    names, stuck = scene_set.along_axes(study, scenes, [np.array(each.stuck_frequency) for each in facts])
    ratios = study.axes.frequency_ratio
    hertz = [] if ratios is None else [(("frequency_ratio", *names), np.multiply.outer(ratios, stuck))]
    return [
        *(SmallArray("frequency", *each, COORDINATES["frequency"]) for each in hertz),
        *coordinates(study, facts, scenes),
        SmallArray("stuck_frequency", names, stuck, STUCK_FREQUENCY),
        *_worn_coordinate(study, facts),
        *sample_coordinates(study, facts, scenes),
        *of_scene,
    ]


def coordinates(study: Study, of_scenes: Sequence[SceneFacts], scenes: scene_set.SceneSet) -> Iterator[SmallArray]:
    """Coordinates of the file but those of samples and worn joints. of_scenes: facts of each."""
    facts = scene_set.merge_facts(of_scenes)
    along: dict[str, Sequence[object] | NDArray[np.generic]] = dict(study.dimensions)
    counted = np.array(study.output_counts, dtype=int if study.mission else float)
    along.setdefault(study.kind.counted or "cycle", counted)
    along |= {"block": [block.name for block in study.mission]} if study.mission else {}
    along |= {"contact": range(facts.contact.n_contact), "response": facts.response_names}
    if study.outputs.loops:
        along |= {"phase": 2.0 * np.pi * np.arange(LOOP_PHASES) / LOOP_PHASES, "component": LOOP_COMPONENTS}
    for name, values in along.items():
        # whole numbers and flags as NetCDF has them; texts where one value is text
        texts = any(isinstance(value, str) for value in values)
        labels = np.array([str(value) for value in values] if texts else values)
        labels = labels.astype({"b": np.int8, "i": np.int32}.get(labels.dtype.kind, labels.dtype))
        yield SmallArray(name, (name,), labels, _coordinate_entry(study, name))
    yield from _of_pairs(study, of_scenes, scenes)
    if facts.edge is not None:
        yield SmallArray("contact_edge", ("contact",), facts.edge.astype(np.int8), COORDINATES["contact_edge"])


def _of_pairs(study: Study, facts: Sequence[SceneFacts], scenes: scene_set.SceneSet) -> Iterator[SmallArray]:
    """Where the pairs are, along the axes along which scenes differ in them; NaN and "" of a pair that one lacks."""
    names, numbers = scene_set.axes_of_difference(study, scenes, [each.pairs for each in facts])
    contacts = [each.contact for each in facts]
    shape = (len(facts), max(each.n_contact for each in contacts))
    position, area = np.full((*shape, 3), np.nan), np.full(shape, np.nan)
    surface = np.full(shape, "", np.array([label for each in contacts for label in each.surface]).dtype)
    for number, each in enumerate(contacts):
        own = slice(each.n_contact)
        position[number, own], area[number, own], surface[number, own] = each.position, each.area, each.surface
    found: dict[str, NDArray[np.generic]] = {f"contact_{axis}": position[..., k] for k, axis in enumerate("xyz")}
    found |= {"contact_area": area, "contact_surface": surface}
    found |= {"contact_exists": np.isfinite(area).astype(np.int8)} if names else {}
    for name, values in found.items():
        yield SmallArray(name, (*names, "contact"), np.array(values[numbers]), COORDINATES[name])


def _coordinate_entry(study: Study, name: str) -> Variable:
    if name == "cycle" and study.to_the_end:
        comment = "Spaced evenly in worn volume and cycles, to the last; cycle_count has the counts of each point."
        return Variable((), "1", "number of the output", comment=comment)
    if name == "sweep" and not study.kind.counted:
        comment = "up: the modal amplitude is raised from zero; down: raised to a larger one, then lowered."
        return Variable((), "1", "how the amplitude is reached", comment=comment)
    for axis in study.scene_axes:
        if axis.name == name:
            return Variable((), axis.units, axis.meaning, comment=f"Key {axis.table}.{axis.dotted} of the study.")
    return COORDINATES[name]


def _worn_coordinate(study: Study, facts: Sequence[SceneFacts]) -> Iterator[SmallArray]:
    """Wear depths with which the histories begin; none where the study has several scenes or no worn one."""
    if study.scene.worn is None or len(facts) > 1:
        return
    axis = next((axis for axis in study.scene_axes if axis.key == ("worn",)), None)
    # the axis of worn states is the last one
    states = (study,) if axis is None else study.variants[: len(axis.values)]
    values = np.array([scene_set.worn_depth(state, facts[0]) for state in states])
    dimensions, values = (("contact",), values[0]) if axis is None else ((axis.name, "contact"), values)
    yield SmallArray("worn_depth", dimensions, values, WORN_DEPTH)


def sample_coordinates(study: Study, facts: Sequence[SceneFacts], scenes: scene_set.SceneSet) -> Iterator[SmallArray]:
    """The drawn values of each input, in its unit, along the samples, and along axes and pairs where they differ.

    NaN where a scene does not have a pair.
    """
    if study.scatter is None:
        return
    of_scenes = {axis.name: len(axis.values) for axis in study.scene_axes}
    drawn = [draw_inputs(variant) for variant in study.variants or (study,)]
    for name, first in drawn[0].items():
        # those drawn around each value of an axis have that axis
        names = (*of_scenes, *((name,) if first.ndim == 2 else ()), "sample")
        values = np.array([each[name] for each in drawn]).reshape(*of_scenes.values(), *first.shape)
        yield _sample_coordinate(study, name, names, values)
    if scene_set.scatters_pairs(study):
        of_parts = [of_part for _, _, of_part in scene_set.drawn_pairs(study, scenes, facts)]
        n_contact = max(each.contact.n_contact for each in facts)
        for name in of_parts[0]:
            values = np.full((len(of_parts), n_contact), np.nan)
            for row, of_part in zip(values, of_parts, strict=True):
                row[: len(of_part[name])] = of_part[name]
            values = values.reshape(*(len(each) for each in study.axes_of_parts.values()), n_contact)
            yield _sample_coordinate(study, name, (*study.axes_of_parts, "contact"), values)


def _sample_coordinate(study: Study, name: str, names: Sequence[str], values: NDArray[np.float64]) -> SmallArray:
    """The values along those of their axes along which they differ, along samples and pairs in any case."""
    dimensions: tuple[str, ...] = ()
    for place, axis in reversed(list(enumerate(names))):
        same = np.broadcast_to(values.take([0], axis=place), values.shape)
        if axis not in ("sample", "contact") and np.array_equal(same, values, equal_nan=True):
            values = np.asarray(values.take(0, axis=place))
        else:
            dimensions = (axis, *dimensions)
    if name in _NAMED:
        units, meaning = _NAMED[name].units, _NAMED[name].long_name
    elif name in study.wear.numbers:
        # `surfaces_flat` is the factor of the surface "flat"
        units, meaning = describe_key(type(study.wear), *name.split("_", 1))
    else:
        units, meaning = describe_key(type(study.scene.parameters), name)
    block, comment = block_of_input(study, name), "By [scatter] of the study."
    if block is not None:
        comment += f" In the block {block.name}; in another block around the value of that block."
    entry = Variable(dimensions, units, f"{meaning}, as the sample draws it", comment=comment)
    return SmallArray(f"sample_{name}", dimensions, np.asarray(values, dtype=np.float64), entry)
