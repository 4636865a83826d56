"""Attributes and coordinates of the variables of a result file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from solver.outcome import Outcome
from studyrunner.coordinates import COORDINATES
from studyrunner.scene.answers import SceneVariable
from studyrunner.scene.scene import SceneFacts
from studyrunner.scene.scene_set import PairArrays
from studyrunner.study.study import Study
from studyrunner.variables import ASKED, LOOP_COMPONENTS, LOOP_PHASES, Variable


@dataclass(frozen=True)
class SmallArray:
    """A coordinate, or a variable that no task computes. over_axes: whether it has the axes of the study, which may be
    of length 1 in `values`.
    """

    name: str
    dimensions: tuple[str, ...]
    values: NDArray[np.generic]
    entry: Variable
    over_axes: bool = False


def attributes(name: str, entry: Variable, of_modes: bool = False) -> dict[str, object]:
    """Attributes of a variable of the file. of_modes: whether it is a file of nonlinear modes."""
    content = "coordinate" if name in COORDINATES else entry.content
    found: dict[str, object] = {"units": entry.units, "long_name": entry.long_name, "coverage_content_type": content}
    comment = entry.comment
    if name in ASKED and "cycle" in entry.dimensions and not entry.dtype.startswith("float"):
        comment = " ".join(filter(None, (comment, "0 where there is no result, see last_cycle.")))
    if comment:
        found["comment"] = comment
    if entry.flags:
        found["flag_values"] = np.arange(len(entry.flags), dtype=entry.dtype)
        found["flag_meanings"] = " ".join(entry.flags)
    if name == "outcome":
        found["flag_values"] = np.array(list(Outcome), dtype=entry.dtype)
        found["flag_meanings"] = " ".join(flag.meaning for flag in Outcome)
        found["sentences"] = "\n".join(flag.sentence_of_mode if of_modes else flag.sentence for flag in Outcome)
    return found


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


def coordinates(study: Study, facts: SceneFacts, pairs: PairArrays) -> Iterator[SmallArray]:
    """Coordinates of the file."""
    along: dict[str, Sequence[object] | NDArray[np.generic]] = dict(study.dimensions)
    counted = study.missions_kept if study.mission else np.array(study.cycles_kept)
    along.setdefault(study.kind.counted or "cycle", counted)
    along |= {"block": [block.name for block in study.mission]} if study.mission else {}
    along |= {"contact": range(len(facts.area)), "response": facts.response_names}
    if study.outputs.loops:
        along |= {"phase": 2.0 * np.pi * np.arange(LOOP_PHASES) / LOOP_PHASES, "component": LOOP_COMPONENTS}
    for name, values in along.items():
        yield SmallArray(name, (name,), _labels(values), _coordinate_entry(study, name))
    of_pairs: dict[str, NDArray[np.generic]] = {
        f"contact_{axis}": pairs.position[..., column] for column, axis in enumerate("xyz")
    }
    of_pairs |= {"contact_area": pairs.area, "contact_surface": pairs.surface}
    if pairs.exists is not None:
        of_pairs["contact_exists"] = pairs.exists.astype(np.int8)
    for name, values in of_pairs.items():
        yield SmallArray(name, pairs.dimensions, np.array(values), COORDINATES[name])
    if facts.edge is not None:
        yield SmallArray("contact_edge", ("contact",), facts.edge.astype(np.int8), COORDINATES["contact_edge"])


def scene_arrays(study: Study, of_scene: Sequence[SceneVariable]) -> Iterator[SmallArray]:
    """Variables of the scene."""
    for each in of_scene:
        own = (each.name,) if each.coordinate else each.entry.dimensions
        dimensions = (*study.dimensions, *own) if each.axes else own
        yield SmallArray(each.name, dimensions, each.values, each.entry, over_axes=each.axes)


def _labels(values: Sequence[object] | NDArray[np.generic]) -> NDArray[np.generic]:
    """Values of an axis: whole numbers in 32 bits, which every NetCDF reader knows; text where one value is text.

    True and false, which NetCDF does not have, are 1 and 0.
    """
    texts = any(isinstance(value, str) for value in values)
    array = np.array([str(value) for value in values] if texts else values)
    if array.dtype.kind == "b":
        return array.astype(np.int8)
    return array.astype(np.int32) if array.dtype.kind == "i" else array
