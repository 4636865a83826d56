"""Attributes and coordinates of the variables of a result file."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from solver.outcome import Outcome
from studyrunner.scene.scene import SceneFacts
from studyrunner.study.study import Study
from studyrunner.variables import ASKED, COORDINATES, LOOP_COMPONENTS, LOOP_PHASES, Variable


def attributes(name: str, entry: Variable) -> dict[str, object]:
    """Attributes of a variable of the file."""
    content = "coordinate" if name in COORDINATES else entry.content
    found: dict[str, object] = {
        "units": entry.units,
        "long_name": entry.long_name,
        "coverage_content_type": content,
    }
    if entry.comment:
        found["comment"] = entry.comment
    if entry.flags:
        found["flag_values"] = np.arange(len(entry.flags), dtype=entry.dtype)
        found["flag_meanings"] = " ".join(entry.flags)
    if name == "outcome":
        found["flag_values"] = np.array(list(Outcome), dtype=entry.dtype)
        found["flag_meanings"] = " ".join(flag.meaning for flag in Outcome)
        found["sentences"] = "\n".join(flag.sentence for flag in Outcome)
    if name in ASKED and not entry.dtype.startswith("float"):
        found["comment"] = " ".join(filter(None, (entry.comment, "0 where there is no result, see last_cycle.")))
    return found


def coordinate_entry(study: Study, name: str) -> Variable:
    """Entry of a coordinate in the list of variables."""
    if name == "cycle" and study.to_the_end:
        comment = "Spaced evenly in worn volume and cycles, to the last; cycle_count has the counts of each point."
        return Variable((), "1", "number of the output", comment=comment)
    return COORDINATES[name]


def coordinates(study: Study, facts: SceneFacts) -> dict[str, tuple[str, NDArray[np.generic]]]:
    """Coordinates of the file: name, dimension, values."""
    found: dict[str, tuple[str, NDArray[np.generic]]] = {
        name: (name, _labels(values)) for name, values in study.dimensions.items()
    }
    found["cycle"] = ("cycle", np.array(study.cycles_kept))
    found["contact"] = ("contact", np.arange(len(facts.area), dtype=np.int32))
    found["response"] = ("response", _labels(facts.response_names))
    if study.outputs.loops:
        found["phase"] = ("phase", 2.0 * np.pi * np.arange(LOOP_PHASES) / LOOP_PHASES)
        found["component"] = ("component", _labels(LOOP_COMPONENTS))
    for column, name in enumerate(("contact_x", "contact_y", "contact_z")):
        found[name] = ("contact", np.array(facts.position[:, column]))
    found["contact_area"] = ("contact", np.array(facts.area))
    found["contact_surface"] = ("contact", _labels(facts.surface))
    return found


def _labels(values: Sequence[object]) -> NDArray[np.generic]:
    """Values of an axis: whole numbers in 32 bits, which every NetCDF reader knows; text where one value is text."""
    texts = any(isinstance(value, str) for value in values)
    array = np.array([str(value) for value in values] if texts else values)
    return array.astype(np.int32) if array.dtype.kind == "i" else array
