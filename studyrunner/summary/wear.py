"""Where a joint wears most, how much and how deep; why nothing wore; its resonance, its life, the effect of meshes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from studyrunner.result.pairs import contact_pairs, has_depths, last_depth
from studyrunner.result.view import NO_VOLUME, WELL_ENOUGH, Point, Result

_NO_MOTION = 1e-12  # m, round-off: less than the size of an atom


@dataclass(frozen=True)
class Number:
    """A value and its absolute error, NaN where that was not estimated; SI."""

    value: float
    error: float = math.nan


@dataclass(frozen=True)
class Deepest:
    """The deepest pair of a point; None and NaN where the file holds no depths of single pairs, or no places."""

    depth: Number  # m
    pair: int | None = None  # index along `contact`
    surface: str = ""
    position: tuple[float, ...] = (math.nan,) * 3  # m
    edge_share: float = math.nan  # of the volume of its surface, what belongs to pairs at the edge of the contact
    edge_area: float = math.nan  # the same of the area


@dataclass(frozen=True)
class MostWear:
    """The point with the largest worn volume, of points that differ in numerical settings only the best known one."""

    point: dict[str, int]  # index along each axis
    where: str  # the point in words
    n_compared: int  # cases that it is the largest of
    n_left_out: int  # cases without a known worn volume, which may wear more
    count: float  # cycles or missions
    volume: Number  # m3
    deepest: Deepest
    blocks: tuple[tuple[str, float], ...] = ()  # of missions, share of each block


@dataclass(frozen=True)
class NothingWore:
    """No point that was computed to the end wears."""

    largest_slip: float  # m, of any pair, 0 where all stick; NaN where the file does not say
    where: str  # these points in words, as "at 212 Hz" or "at all 3 frequencies"


@dataclass(frozen=True)
class Vibration:
    """How the joint responds at a point; amplitudes are NaN where they are known to a factor of two only."""

    of: str  # name of the response
    where: str  # the point in words
    followed: str  # "resonance" or "peak", whose frequency changes while the joint wears; else empty
    # Hz, followed: first and last; else where the unworn joint responds most, NaN at the ends of the frequencies
    frequency: tuple[float, Number]
    amplitude: tuple[Number, Number]  # m, of the unworn and of the worn joint; 0 where the joint does not move
    peak: float = math.nan  # m, of the unworn joint at frequency[0]


@dataclass(frozen=True)
class Life:
    """The shortest life."""

    quantity: str  # of slow_time.until
    target: float
    count: Number  # NaN where no point reaches the target
    where: str
    n_beyond: int  # points computed to the end that do not reach the target
    n_unsure: int = 0  # points whose life is known to a factor of two only


@dataclass(frozen=True)
class MeshChange:
    """How far the worn volumes of two meshes are apart, relative."""

    meshes: tuple[float, float]
    at: str  # "at the resonance", "at equal frequency ratio"
    median: float
    largest: float


def where_is(result: Result, point: Point) -> str:
    """A point in words, along the axes that vary; where none does, its frequency."""
    return result.describe(point, result.varying or ("frequency",))


def most_wear(result: Result) -> MostWear | NothingWore | None:
    """The point that wears most; None where no wear was asked for, or no worn volume is known."""
    best = result.best_known
    if not result.wears or not result.has("worn_volume") or not best.any():
        return None
    worn = np.where(best, result.worn, -1.0)
    if worn.max() <= NO_VOLUME:
        return _nothing(result, best)
    point = result.largest(worn)
    place, at = tuple(point.values()), result.last_reached(point)
    volume = float(worn[place])
    # points that differ in more than steps
    known = xr.DataArray(best, dims=result.axes).any(result.numerical).values
    shares: tuple[tuple[str, float], ...] = ()
    if result.blocks is not None and "block_worn_volume" in result.blocks:
        own = result.blocks["block_worn_volume"].isel(point).isel(cycle=at)
        shares = tuple(zip(own["block"].values.tolist(), (own.values / volume).tolist(), strict=True))
    return MostWear(
        point=point,
        where=where_is(result, point),
        n_compared=int(known.sum()),
        n_left_out=int(known.size - known.sum()),
        count=float(result.counts(point)[at]),
        volume=Number(volume, volume * float(result.errors[place])),
        deepest=_deepest(result, point, at),
        blocks=shares,
    )


def _deepest(result: Result, point: Point, at: int) -> Deepest:
    def read(name: str, *index: int) -> float:
        return float(result.at(name, point, at).values[index]) if result.has(name) else math.nan

    if not has_depths(result):
        return Deepest(Number(read("largest_wear_depth")))
    depth = np.nan_to_num(last_depth(result, point), nan=0.0)
    pair, pairs = int(np.argmax(depth)), contact_pairs(result, point)
    error = read("wear_depth_error", pair) if result.has("wear_depth_error") else read("wear_depth_max_error")
    share = of_area = math.nan
    if result.has("contact_surface", "contact_area", "contact_edge"):
        own, edge = pairs.surface == pairs.surface[pair], result.at("contact_edge", point).values != 0
        if edge[own].any() and depth[own].any():
            ratios = (each[own & edge].sum() / each[own].sum() for each in (depth * pairs.area, pairs.area))
            share, of_area = map(float, ratios)
    surface = str(pairs.surface[pair]) if result.has("contact_surface") else ""
    number = int(result.dataset["contact"].values[pair])
    place = tuple(pairs.position[pair].tolist())
    return Deepest(Number(float(depth[pair]), error), number, surface, place, share, of_area)


def _nothing(result: Result, best: NDArray[np.bool_]) -> NothingWore:
    slip = math.nan
    if result.has("slip_range"):
        largest = result.over_points("slip_range", lambda values: np.nan_to_num(values).max(axis=(1, 2)))
        slip = float(largest[best].max())
    n_points, n_computed = result.computed.size, int(np.count_nonzero(result.computed))
    only = result.varying[0] if len(result.varying) == 1 else ""
    words = {"frequency": "at {} frequencies", "sample": "in {} samples"}.get(only, "at {} points")
    if n_computed < n_points:
        where = f"{words.format(f'{n_computed} of {n_points}')}, the others have no result"
    elif n_points > 1:
        where = words.format(f"all {n_points}")
    else:
        where = f"at {where_is(result, result.shown_point()) or 'the only point'}"
    return NothingWore(0.0 if slip < _NO_MOTION else slip, where)


def vibration_of(result: Result, wear: MostWear | NothingWore | None) -> Vibration | None:
    """How the joint responds at the point that wears most, else at the one that is shown."""
    point = wear.point if isinstance(wear, MostWear) else result.shown_point()
    place = tuple(point[name] for name in result.axes)
    if result.blocks is not None or not result.has("response_amplitude") or not result.computed[place]:
        return None
    ends = [0, result.last_reached(point)]
    amplitude = result.at("response_amplitude", point, ends).transpose("cycle", "response").values
    of = int(np.argmax(amplitude[0]))
    values = np.where(amplitude[:, of] > _NO_MOTION, amplitude[:, of], 0.0)
    errors = result.at("response_error", point, ends).values if result.has("response_error") else np.full(2, np.nan)
    values = np.where((errors > WELL_ENOUGH) & (values > 0.0), np.nan, values)
    new, worn = map(Number, values.tolist(), (errors * values).tolist())
    name, where = result.responses[of], where_is(result, point)
    if result.followed and result.has("excitation_frequency"):
        first, last = result.at("excitation_frequency", point, ends).values.tolist()
        known = result.has("excitation_frequency_error")
        error = float(result.at("excitation_frequency_error", point, ends[1])) if known else math.nan
        return Vibration(name, where, result.followed, (first, Number(last, error)), (new, worn))
    frequency, peak = _peak(result, point, of)
    return Vibration(name, where, "", (frequency, Number(math.nan)), (new, worn), peak)


def _peak(result: Result, point: Point, of: int) -> tuple[float, float]:
    """Frequency, Hz, and amplitude, m, of the largest response of the unworn joint; NaN at the ends of the range."""
    if result.dataset.sizes.get("frequency", 1) < 3:
        return math.nan, math.nan
    others = {name: index for name, index in point.items() if name != "frequency"}
    row = result.at("response_amplitude", others, 0).isel(response=of)
    there = result.has_values[tuple(others.get(name, slice(None)) for name in result.axes)]
    order = np.argsort(row["frequency"].values)
    values = np.where(there, row.values, np.nan)[order]
    top = 0 if np.isnan(values).all() else int(np.nanargmax(values))
    if not 0 < top < len(values) - 1 or np.isnan(values[top - 1 : top + 2]).any():
        return math.nan, math.nan
    return float(row["frequency"].values[order][top]), float(values[top])


def shortest_life(result: Result) -> Life | None:
    """The shortest life of the points of a study with a target; None without a target."""
    until = result.study.get("slow_time", {}).get("until")
    if not isinstance(until, dict) or not result.has("cycles_to_target"):
        return None
    (quantity, target), *_ = until.items()
    found = result.computed & ~result.ended("sensitive")
    lives, errors = (result.dataset[name].values for name in ("cycles_to_target", "cycles_to_target_error"))
    unsure = found & (errors > WELL_ENOUGH * lives)
    counts = int(np.count_nonzero(found & np.isnan(lives))), int(np.count_nonzero(unsure))
    lives = np.where(found & ~unsure, lives, np.nan)
    shortest, where = Number(math.nan), ""
    if not np.isnan(lives).all():
        point = result.largest(-np.nan_to_num(lives, nan=np.inf))
        place = tuple(point.values())
        shortest, where = Number(float(lives[place]), float(errors[place])), where_is(result, point)
    return Life(str(quantity), float(target), shortest, where, *counts)


def compare_meshes(result: Result) -> MeshChange | None:
    """How far worn volumes of the two finest meshes are apart, at equal distance to the resonance; else None.

    The resonance moves with the mesh: at one frequency one mesh may wear a multiple of the other.
    """
    at = f"at the {result.followed}" if result.followed else ""
    at = at or ("at equal frequency ratio" if "frequency_ratio" in result.axes else "")
    if not at or "mesh" not in result.varying or not result.wears or not result.has("worn_volume"):
        return None
    meshes, axis = result.dataset["mesh"].values.astype(float), result.axes.index("mesh")
    two = np.argsort(meshes)[-2:]
    volumes = np.where(result.best_known, result.worn, np.nan).take(two, axis=axis)
    larger = np.fmax.reduce(volumes, axis=axis)
    apart = np.abs(np.diff(volumes, axis=axis).squeeze(axis)) / np.where(larger > NO_VOLUME, larger, np.nan)
    if np.isnan(apart).all():
        return None
    return MeshChange((meshes[two[0]], meshes[two[1]]), at, float(np.nanmedian(apart)), float(np.nanmax(apart)))
