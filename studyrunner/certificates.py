"""How right the results of a run are: the worst certificate values, and the folds and jumps on the way, as a table."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from studyrunner.evaluate import CONVERGED
from studyrunner.progress import count
from studyrunner.results import MarchResult
from studyrunner.study import Study
from studyrunner.tasks import Index
from studyrunner.variables import CERTIFICATE, COORDINATES

_NOT_OF_A_SWEEP = ("wear_coefficient", "step", "scheme")
_FOLDS_NAMED = 5


@dataclass(frozen=True, order=True)
class _Place:
    """A point of a study and a count among the cycles kept; None for the point as a whole. Ordered as in the file."""

    point: Index
    cycle: int | None = None


def summarise_certificates(study: Study, results: Sequence[MarchResult]) -> str:
    """Table in lines: the largest value of each certificate over all converged points, with its place, then how many
    folds, jumps, too long steps, oscillating wear rates and unstable states there are. The order of results does not
    matter.
    """
    converged = [result for result in results if result.outcome == CONVERGED]
    n_converged = sum(len(result.points) for result in converged)
    rows = [("worst certificate of", f"{count(n_converged, 'point')} computed to tolerance")]
    rows.extend((f"  {label}", _worst(study, name, converged)) for name, label in CERTIFICATE.items())
    rows.append(("folds in the sweeps", _folds(study, results)))
    rows.append(("jumps while wearing", _jumps(study, results)))
    rows.append(("explicit steps too long", _listed(study, _too_long(study, results), "longer than step_limit")))
    oscillating = [min(result.points) for result in results if result.oscillates]
    rows.append(("oscillating wear rate", _listed(study, oscillating, "use a smaller step or the implicit scheme")))
    unstable = [min(result.points) for result in converged if not np.all(result.values["stable"])]
    rows.append(("unstable states", _listed(study, unstable, "see the variable stable")))
    width = max(len(label) for label, _ in rows)
    return "\n".join(f"{label:<{width}}  {text}" for label, text in rows)


def _worst(study: Study, name: str, converged: Sequence[MarchResult]) -> str:
    """Largest value and its place; the first in the order of the file where several are equal."""
    found = list(_candidates(name, converged))
    if not found:
        return "not estimated" if converged else "none"
    largest = max(value for value, _ in found)
    place = min(place for value, place in found if value == largest)
    where = _where(study, place)
    return f"{largest:.1e}" + (f" at {where}" if where else "")


def _candidates(name: str, converged: Sequence[MarchResult]) -> Iterator[tuple[float, _Place]]:
    """The largest value of each history that has any."""
    for result in converged:
        values = np.asarray(result.values[name], dtype=np.float64)
        if not np.isnan(values).all():
            cycle = int(np.nanargmax(values))
            yield float(values[cycle]), _Place(min(result.points), cycle)


def _folds(study: Study, results: Sequence[MarchResult]) -> str:
    """Folds at which a sweep left its branch. Points that differ in their wear only share the sweep and its folds."""
    kept = [axis for axis, name in enumerate(study.dimensions) if name not in _NOT_OF_A_SWEEP]
    folds = {
        (tuple(point[axis] for axis in kept), result.fold_frequency)
        for result in results
        if not math.isnan(result.fold_frequency)
        for point in result.points
    }
    if not folds:
        return "none"
    frequencies = sorted({frequency for _, frequency in folds})
    more = ", ..." if len(frequencies) > _FOLDS_NAMED else ""
    return f"{len(folds)}, at {', '.join(f'{value:.6g} Hz' for value in frequencies[:_FOLDS_NAMED])}{more}"


def _jumps(study: Study, results: Sequence[MarchResult]) -> str:
    """Histories that lost their branch, and the earliest of them."""
    jumps = sorted((result.jump_cycle, min(result.points)) for result in results if not math.isnan(result.jump_cycle))
    if not jumps:
        return "none"
    where = _where(study, _Place(jumps[0][1]))
    return f"{len(jumps)}, the first at cycle {jumps[0][0]:g}" + (f" at {where}" if where else "")


def _too_long(study: Study, results: Sequence[MarchResult]) -> list[Index]:
    """Points of the explicit scheme whose step is longer than what is predicted to be stable."""
    if study.slow_time.largest_depth is not None:
        return []
    names = list(study.dimensions)
    scheme, step = names.index("scheme"), names.index("step")
    return [
        point
        for result in results
        for point in result.points
        if study.axes.scheme[point[scheme]] == "explicit"
        and min(study.axes.step[point[step]], study.cycles_kept[-1]) > result.step_limit
    ]


def _listed(study: Study, points: Sequence[Index], remedy: str) -> str:
    """How many of them, where the first is, and what there is to say."""
    if not points:
        return "none"
    where = _where(study, _Place(min(points)))
    return f"{len(points)}, the first at {where}: {remedy}" if where else f"{len(points)}: {remedy}"


def _where(study: Study, place: _Place) -> str:
    """Coordinates of a place along those dimensions that have more than one value."""
    texts = []
    for (name, values), index in zip(study.dimensions.items(), place.point, strict=True):
        if len(values) > 1:
            value, units = values[index], COORDINATES[name].units
            shown = value if isinstance(value, str) else f"{value:.8g}"
            texts.append(f"{name} {shown}" + (f" {units}" if units != "1" else ""))
    if place.cycle is not None and len(study.cycles_kept) > 1:
        texts.append(f"cycle {study.cycles_kept[place.cycle]:.8g}")
    return ", ".join(texts)
