"""What came out of a study, piece by piece, with its words: the most wear, the response, the life, meshes, modes.

Only results are in it: a history that was not computed to the end, or is known to a factor of two only, has no number.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from studyrunner.result.pairs import contact_pairs, has_depths, last_depth
from studyrunner.result.view import NO_VOLUME, WELL_ENOUGH, Point, Result
from studyrunner.statistics.samples import SAMPLE
from studyrunner.statistics.study_statistics import describe_ranking, describe_volumes
from studyrunner.system.progress import count
from studyrunner.units import scale_for, show_cycles, show_number, show_percent

_NO_MOTION = 1e-12  # m, round-off: less than the size of an atom
_LEAST = 1e-4  # relative error that is shown, of any smaller one
_SHARE = 0.5
"""Of the wear of a surface that lies at its edge: more, and more than its share of the area, is pointed out."""


@dataclass(frozen=True)
class Number:
    """A value and its absolute error, NaN where that was not estimated; SI."""

    value: float
    error: float = math.nan

    def show(self, units: str) -> str:
        """The number with its error: "1.52 mm3 ± 1.3 %"."""
        if math.isnan(self.value):
            return "not known"
        text = scale_for(units, self.value).show(self.value)
        if math.isnan(self.error):
            return f"{text} (error not known)"
        return f"{text} ± {show_percent(max(self.error / self.value, _LEAST))}" if self.value > 0.0 else text


@dataclass(frozen=True)
class Deepest:
    """The deepest pair of a point; None and NaN where the file holds no depths of single pairs, or no places."""

    depth: Number  # m
    pair: int | None = None  # index along `contact`
    surface: str = ""
    position: tuple[float, ...] = (math.nan,) * 3  # m
    edge_share: float = math.nan  # of the volume of its surface, what belongs to pairs at the edge of the contact
    edge_area: float = math.nan  # the same of the area

    @property
    def text(self) -> str:
        """How deep and where; whether most is worn at the edge."""
        text = self.depth.show("m")
        if self.pair is not None:
            text += f" at contact pair {self.pair}" + (f" of {self.surface}" if self.surface else "")
            if all(map(math.isfinite, self.position)):
                text += f", (x, y, z) = ({', '.join(f'{1e3 * each:.4g}' for each in self.position)}) mm"
        if self.edge_share > max(_SHARE, self.edge_area):
            text += (
                f"; {show_percent(self.edge_share)} of the wear of {self.surface or 'its surface'} is in edge pairs:"
            )
            text += " valid if the real contact ends there, else extend the model"
        return text


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

    def text(self, counted: str) -> str:
        """How much, when and where. counted: what slow time counts."""
        text = f"{self.volume.show('m3')} after {show_cycles(self.count, counted)} at {self.where}"
        if self.n_left_out:
            more = f"{count(self.n_left_out, 'case')} without a known volume"
            text += f", the most of {self.n_compared} cases; {more} may wear more"
        return text


@dataclass(frozen=True)
class NothingWore:
    """No point that was computed to the end wears."""

    largest_slip: float  # m, of any pair, 0 where all stick; NaN where the file does not say
    where: str  # these points in words, as "at 212 Hz" or "at all 3 points"

    @property
    def text(self) -> str:
        """Why nothing wore, and where."""
        why = ": all pairs stick" if self.largest_slip == 0.0 else ""
        if self.largest_slip > 0.0:
            why = f": pairs slip by up to {scale_for('m', self.largest_slip).show(self.largest_slip)} without wear"
        return f"nothing wore{why} {self.where}"


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

    def text(self, wears: bool, alone: bool) -> str:
        """wears: whether the joint does. alone: whether the study has one point."""
        if all(each.value == 0.0 for each in self.amplitude):
            return f"{self.of} does not move"
        (first, last), (start, end) = self.amplitude, self.frequency
        if self.followed:
            known = "" if math.isnan(end.error) else f" ± {end.error:.2g}"
            moved = f"moved from {start:.6g} to {end.value:.6g}{known} Hz" if wears else f"at {start:.6g} Hz"
            return f"{moved}, response of {self.of} {first.show('m')}" + (f" to {last.show('m')}" if wears else "")
        case = "" if alone else " in this case" if wears else f", most at {self.where}"
        text = f"{self.of}{case}: amplitude {first.show('m')}"
        if wears:
            elsewhere = " (its resonance may lie elsewhere)" if last.value < first.value else ""
            text += f" when new, {last.show('m')} when worn{elsewhere}"
        if math.isfinite(start):
            text += f"; the new joint responds most at {start:.6g} Hz ({scale_for('m', self.peak).show(self.peak)})"
        return text


@dataclass(frozen=True)
class Life:
    """The shortest life."""

    quantity: str  # of slow_time.until
    target: float
    count: Number  # NaN where no point reaches the target
    where: str
    n_beyond: int  # points computed to the end that do not reach the target
    n_unsure: int = 0  # points whose life is known to a factor of two only

    def text(self, counted: str) -> str:
        """The shortest life, and how many points have none. counted: what slow time counts."""
        units = {"wear_depth": "m", "worn_volume": "m3"}.get(self.quantity, "1")
        target = f"{self.quantity.replace('_', ' ')} {scale_for(units, self.target).show(self.target)}"
        unsure = f"; the life of {count(self.n_unsure, 'point')} is not known" if self.n_unsure else ""
        if math.isnan(self.count.value):
            return f"no {'other ' if unsure else ''}point computed to the end reaches {target}{unsure}"
        known = "(error not known)"
        if math.isfinite(self.count.error):
            known = f"± {show_percent(self.count.error / self.count.value)}"
        text = f"{show_cycles(round(self.count.value), counted)} {known} to {target} at {self.where}{unsure}"
        return text + (f"; not reached by {count(self.n_beyond, 'point')}" if self.n_beyond else "")


@dataclass(frozen=True)
class MeshChange:
    """How far the worn volumes of two meshes are apart, relative."""

    meshes: tuple[float, float]
    at: str  # "at the resonance", "at equal frequency ratio"
    median: float
    largest: float

    @property
    def text(self) -> str:
        """Both meshes and their differences."""
        coarse, fine = map(show_number, self.meshes)
        text = f"worn volumes of meshes {coarse} and {fine} differ by {show_percent(self.median)} {self.at}"
        return f"{text}, at most {show_percent(self.largest)}" if self.largest > self.median else text


@dataclass(frozen=True)
class ModeRange:
    """Natural frequency, Hz, and damping ratio of a mode: ends of their ranges over the points that were found."""

    number: int
    over: str  # what varies, in words
    frequency: tuple[float, float]
    damping: tuple[float, float]
    n_found: int
    n_points: int

    @property
    def text(self) -> str:
        """The ranges and how many points they are of."""
        found = f"found at {self.n_found} of {count(self.n_points, 'point')}"
        ranges = ("natural frequency", self.frequency, 1.0, 6, " Hz"), ("damping ratio", self.damping, 100.0, 3, " %")
        known = [
            f"{name} {' to '.join(dict.fromkeys(f'{factor * each:.{digits}g}' for each in ends))}{unit}"
            for name, ends, factor, digits, unit in ranges
            if not math.isnan(ends[0])
        ]
        text = ", ".join(known) + (f" over {self.over}" if known and self.over else "")
        return text if known and self.n_found == self.n_points else ", ".join(filter(None, (text, found)))


def where_is(result: Result, point: Point) -> str:
    """A point in words, along the axes that vary; where none does, its frequency."""
    return result.describe(point, result.varying or ("frequency",)) or "the only point"


# --- wear ---


def most_wear(result: Result) -> MostWear | NothingWore | None:
    """The point that wears most; None where no wear was asked for, or no worn volume is known."""
    best = result.best_known
    if not result.wears or not result.has("worn_volume") or not best.any():
        return None
    worn = np.where(best, result.worn, -1.0)
    if worn.max() <= NO_VOLUME:
        return _nothing(result, best)
    point = result.largest(worn)
    place, at = result.place(point), result.last_reached(point)
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
        largest = result.over_points("slip_range", lambda values: np.nan_to_num(values).max(axis=-1))
        slip = float(largest[best].max())
    n_points, n_computed = result.computed.size, int(np.count_nonzero(result.computed))
    where = f"at all {n_points} points" if n_points > 1 else f"at {where_is(result, result.shown)}"
    if n_computed < n_points:
        where = f"at {n_computed} of {n_points} points, the others have no result"
    return NothingWore(0.0 if slip < _NO_MOTION else slip, where)


def describe_samples(result: Result) -> tuple[str, str]:
    """Worn volumes of the samples where their median is largest, and which input decides; empty without samples."""
    statistics = result.statistics
    if statistics is None:
        return "", ""
    last = statistics.isel(cycle=-1, missing_dims="ignore")
    medians = last["worn_volume_quantile"].sel(quantile=0.5).isel(bound=0)
    place = np.unravel_index(int(np.argmax(medians.values)), medians.shape)
    point = dict(zip(map(str, medians.dims), map(int, place), strict=True))
    where = result.describe(point, [name for name in result.varying if name != SAMPLE])
    more = f" (of {medians.size} points the one with the largest median)" if medians.size > 1 else ""
    after = f" after {result.cycle_label(-1)}" + (f", at {where}" if where else "")
    return f"{describe_volumes(last.isel(point))}{after}{more}", describe_ranking(last.isel(point))


# --- vibration ---


def vibration_of(result: Result, wear: MostWear | NothingWore | None) -> Vibration | None:
    """How the joint responds at the point that wears most, else at the one that is shown."""
    point = wear.point if isinstance(wear, MostWear) else result.shown
    if result.blocks is not None or not result.has("response_amplitude") or not result.computed[result.place(point)]:
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


def mode_ranges(result: Result) -> tuple[ModeRange, ...]:
    """Each mode over all other axes."""
    numbers = [name for name in result.varying if name != "mode" and result.dataset[name].dtype.kind in "iuf"]
    ends = {name: [show_number(float(result.dataset[name].values[place])) for place in (0, -1)] for name in numbers}
    over = ", ".join(f"{name.replace('_', ' ')} {' to '.join(each)}" for name, each in ends.items())
    axis, found = result.axes.index("mode"), []
    for index, number in enumerate(result.dataset["mode"].values.tolist()):
        computed = result.computed.take(index, axis=axis)
        ranges = list[tuple[float, float]]()
        for name in ("natural_frequency", "damping_ratio"):
            there = result.has(name) and computed.any()
            values = result.dataset[name].values.take(index, axis=axis)[computed] if there else np.array([np.nan])
            ranges.append((float(values.min()), float(values.max())))
        frequency, damping = ranges
        found.append(ModeRange(int(number), over, frequency, damping, int(computed.sum()), computed.size))
    return tuple(found)


# --- life and meshes ---


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
        place = result.place(point)
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
