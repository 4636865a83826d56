"""Attributes of the variables of a result file, and all of its arrays that no task computes."""

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from solver.outcome import Outcome
from studyrunner.coordinates import COORDINATES, OF_SCENE, POINT, SAMPLE
from studyrunner.kinds.wear.kind import ASKED
from studyrunner.points.table import Column, Points
from studyrunner.scatter import SECTOR_FREQUENCY
from studyrunner.scene import scene_set
from studyrunner.scene.answers import SmallArray
from studyrunner.scene.scene import SceneFacts, dimensions_behind
from studyrunner.study.scene_axes import describe_key
from studyrunner.study.sections import SOLVER_AXES
from studyrunner.study.study import Study
from studyrunner.variables import Variable

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
    points, hertz = scenes.points, []
    if study.axes.frequency_ratio is not None:
        along = "frequency_ratio" if "frequency_ratio" in points.dims else POINT
        hertz = [points.array(scene_set.frequencies(study, scenes, facts), keep=(along,))]
    return [
        *(SmallArray("frequency", *each, COORDINATES["frequency"]) for each in hertz),
        *coordinates(study, facts, scenes),
        _of_scene("stuck_frequency", *scenes.along_axes([np.array(each.stuck_frequency) for each in facts])),
        *_worn_coordinate(study, facts, points),
        *sample_coordinates(study, facts, scenes),
        *of_scene,
    ]


def _of_scene(name: str, along: Sequence[str], values: NDArray[np.generic]) -> SmallArray:
    return SmallArray(name, (*along, *OF_SCENE[name].dimensions), values, OF_SCENE[name])


def coordinates(study: Study, of_scenes: Sequence[SceneFacts], scenes: scene_set.SceneSet) -> Iterator[SmallArray]:
    """Coordinates of the file but those of samples and worn joints. of_scenes: facts of each."""
    facts = scene_set.merge_facts(of_scenes)
    along: dict[str, Sequence[object] | NDArray[np.generic]] = dict(study.dimensions)
    along |= dimensions_behind(study, facts)
    dims = {name: name for name in along}
    if study.design is not None:
        tables = {axis.name: axis.values for axis in study.scene_axes}
        for name, column in study.design.columns.items():
            given = tables.get(name) or getattr(study.solver if name in SOLVER_AXES else study.axes, name)
            along[name], dims[name] = [given[place] for place in column.codes.tolist()], POINT
    for name, values in along.items():
        # whole numbers and flags as NetCDF has them; texts where one value is text
        texts = any(isinstance(value, str) for value in values)
        labels = np.array([str(value) for value in values] if texts else values)
        labels = labels.astype({"b": np.int8, "i": np.int32}.get(labels.dtype.kind, labels.dtype))
        yield SmallArray(name, (dims[name],), labels, _coordinate_entry(study, name))
    yield from _of_pairs(of_scenes, scenes)
    if facts.edge is not None:
        yield _of_scene("contact_edge", (), facts.edge)
    if study.scene.ring is not None:
        sectors = np.repeat(np.arange(facts.n_ring, dtype=np.int32), facts.contact.n_contact // facts.n_ring)
        yield _of_scene("contact_sector", (), sectors)
        deviations = np.array(study.scene.ring.frequency or np.zeros(facts.n_ring))
        yield _of_scene(SECTOR_FREQUENCY, (), deviations)


def _of_pairs(facts: Sequence[SceneFacts], scenes: scene_set.SceneSet) -> Iterator[SmallArray]:
    """Where the pairs are, along the axes along which scenes differ in them; NaN and "" of a pair that one lacks."""
    same = {each.pairs: np.array(number) for number, each in enumerate(facts)}
    names, numbers = scenes.along_axes([same[each.pairs] for each in facts])
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
        yield _of_scene(name, names, np.array(values[numbers]))


def _coordinate_entry(study: Study, name: str) -> Variable:
    if name == "cycle" and study.to_the_end:
        comment = "Spaced evenly in worn volume and cycles, to the last; cycle_count has the counts of each point."
        return Variable((), "1", "number of the output", comment=comment)
    for axis in study.scene_axes:
        if axis.name == name:
            return Variable((), axis.units, axis.meaning, comment=f"Key {axis.table}.{axis.dotted} of the study.")
    return {**COORDINATES, **study.kind.coordinates}[name]


def _worn_coordinate(study: Study, facts: Sequence[SceneFacts], points: Points) -> Iterator[SmallArray]:
    """Wear depths with which the histories begin; none where the study has several scenes or no worn one."""
    if scene_set.begins_worn(study) and len(facts) == 1:
        axes = [axis.name for axis in study.scene_axes if axis.is_worn]
        names, values = points.along([scene_set.worn_depth(each, facts[0]) for each in points.studies], keep=axes)
        yield _of_scene("worn_depth", names, values)


def sample_coordinates(study: Study, facts: Sequence[SceneFacts], scenes: scene_set.SceneSet) -> Iterator[SmallArray]:
    """The drawn values of each input, in its unit, along the samples, and along axes and pairs where they differ.

    NaN where a scene does not have a pair.
    """
    if study.scatter is None:
        return
    points = scenes.points
    for name in study.scatter.inputs:
        if name not in study.scatter.of_pairs:
            yield _sample_coordinate(study, name, *points.array(_drawn(study, points, name), keep=(SAMPLE,)))
    of_studies = scene_set.drawn_pairs(study, scenes, facts)
    for name in study.scatter.of_pairs:
        of_what = "sector" if name == SECTOR_FREQUENCY else "contact"
        n = max(each.n_ring if of_what == "sector" else each.contact.n_contact for each in facts)
        values = np.full((len(of_studies), n), np.nan)
        for row, drawn in zip(values, of_studies, strict=True):
            row[: len(drawn[name])] = drawn[name]
        names, values = points.along(list(values), keep=(SAMPLE,))
        yield _sample_coordinate(study, name, (*names, of_what), values)


def _drawn(study: Study, points: Points, name: str) -> Column:
    """What the samples draw of an input that is the same for all pairs."""
    in_block, parts = study.is_in_blocks(name), [each.part_of(name) for each in points.studies]
    if name in study.kind.numbers:
        axes = [getattr(each.axes, name) for each in parts]
        places = points.columns[name]
        return points.combined(lambda number, at: axes[number][0 if in_block else at], points.columns["study"], places)
    return points.of_studies([{**dict(each.scene.parameters), **each.wear.numbers}[name] for each in parts])


def _sample_coordinate(study: Study, name: str, dimensions: tuple[str, ...], values: NDArray[np.float64]) -> SmallArray:
    if name in _NAMED:
        units, meaning = _NAMED[name].units, _NAMED[name].long_name
    elif name in study.wear.numbers:
        # `surfaces_flat` is the factor of the surface "flat"
        units, meaning = describe_key(type(study.wear), *name.split("_", 1))
    else:
        units, meaning = describe_key(type(study.scene.parameters), name)
    comment = "By [scatter] of the study."
    if block := study.part_of(name).block:
        comment += f" In the block {block}; in another block around the value of that block."
    entry = Variable(dimensions, units, f"{meaning}, as the sample draws it", comment=comment)
    return SmallArray(f"sample_{name}", dimensions, np.asarray(values, dtype=np.float64), entry)
