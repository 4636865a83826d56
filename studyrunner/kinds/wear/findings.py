"""What came out of wear histories: the most wear or why nothing wore, the response, life, meshes."""

import math
from collections.abc import Iterator
from typing import Any, cast

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from solver.outcome import SENSITIVE_ERROR, Outcome
from studyrunner.coordinates import SAMPLE
from studyrunner.kinds.wear.meshes import compare_meshes
from studyrunner.kinds.wear.response import describe_response
from studyrunner.kinds.wear.ring import describe_ring
from studyrunner.kinds.wear.sought import find_allowable
from studyrunner.result.pairs import contact_pairs, has_depths, last_depth
from studyrunner.result.view import NO_MOTION, NO_VOLUME, Point, Result
from studyrunner.statistics.read_samples import LIFE
from studyrunner.statistics.samples import DRAWN
from studyrunner.statistics.sentences import describe_limit, describe_ranking, describe_volumes
from studyrunner.statistics.study_statistics import QUANTITIES
from studyrunner.study.scene_section import WORN_AXIS, worn_before
from studyrunner.summary.findings import LEAST_ERROR, Finding, show, where_is, with_error
from studyrunner.system.progress import count
from studyrunner.units import show_cycles, show_known, show_percent

_MOST_ALIKE = 3
_AFTER_THE_START = ("excitation_amplitude", "wear_coefficient", "step", "scheme")  # what slip does not depend on
MEASURED_POWER = (2e3, 4.3e5)
"""Power densities of friction, W/m2, of the tests of the law "power" (Fouvry and others 2017)."""

_SHARE = 0.5
"""Of the wear of a surface that lies at its edge: more, and more than its share of the area, is pointed out."""


def what_came_out(result: Result, stuck: float) -> Iterator[Finding]:
    """Wear, response, life, meshes. stuck: first frequency with the joint stuck, Hz, or NaN."""
    sought = result.has("allowable_amplitude")
    if sought:
        yield find_allowable(result)
    yield from _wear_and_response(result, stuck)
    life = None if sought else _shortest_life(result)
    yield from filter(None, (life, compare_meshes(result), _power(result), describe_ring(result)))


def _power(result: Result) -> Finding | None:
    """The largest power density of friction, beside those at which the law "power" was measured; None of other laws."""
    wear = cast("dict[str, Any]", result.study.get("wear", {}))
    if wear.get("law") != "power" or not result.has("friction_power"):
        return None
    of_points = result.over_points("friction_power", lambda values: np.nan_to_num(values).max(axis=-1))
    largest, (low, high) = float(of_points.max(initial=0.0)), MEASURED_POWER
    within = "within" if low <= largest <= high else "beyond" if largest > high else "below"
    text = f"friction has up to {largest / 1e3:.3g} kW/m2, {within} the {low / 1e3:g} to {high / 1e3:g} kW/m2 of the"
    text += " tests of this law"
    return Finding("power", "power", text, {"largest": largest, "is_measured": within == "within"})


def errors_of(result: Result, *, wore: bool) -> tuple[str, NDArray[np.float64]] | None:
    """What is known with which relative errors: worn volumes, or where nothing wore responses; None without errors."""
    responses = result.has("response_error")
    has_errors = result.has("error_estimate") and np.isfinite(result.rtol).any() and result.computed.any()
    if result.wears and has_errors and (wore or not responses):
        return "worn volume", result.errors
    return ("response", result.of_points("response_error", -1)) if responses else None


# --- wear and vibration ---


def _wear_and_response(result: Result, stuck: float) -> Iterator[Finding]:
    """The point that wears most, of points that differ in numerical settings only the best known one; its response.

    Where no wear is known, the response of the point that figures show. stuck: first frequency with the joint stuck,
    Hz, NaN where it is not known.
    """
    best, point, wears = result.best_known, result.shown, False
    if result.has("worn_volume"):
        # of a selection of cycle counts, or where the target comes before the second of them
        best = best & np.isfinite(result.worn)
    resonance = f"first resonance {stuck:.4g} Hz when all pairs stick" if math.isfinite(stuck) else ""
    if result.wears and result.has("worn_volume") and best.any():
        worn = np.where(best, result.worn, -1.0)
        wears = float(worn.max()) > NO_VOLUME
        # points that were sought all wear the same
        sought = result.has("allowable_amplitude")
        point = result.largest(worn) if wears and not sought else point
        if sought and wears:
            yield _deepest(result, point, result.last_reached(point), f" ({where_is(result, point)})")
        else:
            yield from _of_wear(result, point) if wears else [_nothing(result, resonance)]
    elif result.statistics is not None and f"{LIFE}_quantile" in result.statistics:
        # all points may end before the first count at which the file could hold wear
        lives, ranking = _of_samples(result)
        yield Finding("wear", "wear", lives)
        yield from [Finding("input", "input", ranking)] if ranking else []
    elif result.wears and result.has("worn_volume", "error_estimate") and result.computed.any():
        yield Finding("wear", "wear", "no worn volume is known within 50 %")
    yield from _of_limits(result)
    if result.has("response_amplitude") and result.computed[result.place(point)]:
        yield describe_response(result, point, wears, resonance)


def _of_wear(result: Result, point: dict[str, int]) -> Iterator[Finding]:
    place, at, where = result.place(point), result.last_reached(point), where_is(result, point)
    volume, end = float(result.worn[place]), float(result.counts(point)[at])
    error = volume * float(result.errors[place])
    # points that differ in more than steps
    known = xr.DataArray(result.best_known, dims=result.axes).any(result.numerical).values
    n_compared, n_left_out = int(known.sum()), int(known.size - known.sum())
    text = f"{with_error(volume, error, 'm3')} after {show_cycles(end, result.counted)} at {where}"
    if n_left_out:
        more = f"{count(n_left_out, 'case')} without a known volume"
        best = f"the most of {n_compared} cases" if n_compared > 1 else "the only known case"
        text += f", {best}; {more} may wear more"
    volumes, ranking = _of_samples(result)
    values = {"point": point, "worn_volume": volume, "error": error, "count": end}
    values |= {"n_compared": n_compared, "n_left_out": n_left_out}
    yield Finding("wear", "wear" if volumes or n_compared == 1 else "most wear", volumes or text, values)
    if ranking:
        yield Finding("input", "input", ranking)
    yield _deepest(result, point, at, f" in the sample that wears most ({where})" if volumes else "")


def _of_samples(result: Result) -> tuple[str, str]:
    """Worn volumes of the samples where their median is largest, or lives where it is least, and which input decides;
    empty without samples.
    """
    if result.statistics is None:
        return "", ""
    last = result.statistics.isel(cycle=-1, missing_dims="ignore")
    of_life = f"{LIFE}_quantile" in last
    medians = last[f"{LIFE if of_life else 'worn_volume'}_quantile"].sel(quantile=0.5).isel(bound=0).values
    flat, why = (np.argmin(medians), "shortest") if of_life else (np.argmax(medians), "largest")
    there, where = _chosen(result, last, int(flat), f"with the {why} median")
    said, ranking = describe_volumes(there), describe_ranking(there)
    if of_life:
        return said.replace("cycles", result.counted) + where, f"of the life, {ranking}" if ranking else ""
    return f"{said} after {result.cycle_label(-1)}{where}", ranking


def _of_limits(result: Result) -> Iterator[Finding]:
    """The probability of each limit, where it is least."""
    last = xr.Dataset() if result.statistics is None else result.statistics.isel(cycle=-1, missing_dims="ignore")
    texts, values = list[str](), dict[str, Any]()
    for name in QUANTITIES:
        if f"{name}_limit" in last:
            least = int(np.argmin(last[f"{name}_within_limit_interval"].isel(bound=0).values))
            there, where = _chosen(result, last, least, "that is least probable")
            texts.append(describe_limit(there, name) + where)
            parts = {"limit": "limit", "probability": "within_limit", "interval": "within_limit_interval"}
            own = name.replace("cycles", result.counted)
            values[own] = {key: there[f"{name}_{each}"].values.tolist() for key, each in parts.items()}
            values[own]["n_unknown"] = int(there[f"{name}_not_placed"])
    if texts:
        after = "" if f"{LIFE}_limit" in last else f"after {result.cycle_label(-1)}: "
        yield Finding("limits", "limits", after + "; ".join(texts).replace("cycles", result.counted), values)


def _chosen(result: Result, last: xr.Dataset, flat: int, why: str) -> tuple[xr.Dataset, str]:
    """Statistics of the point of this number, and in words where it is. why: it is chosen."""
    sizes = last["n_without_value"].sizes
    place = np.unravel_index(flat, tuple(sizes.values()))
    point = dict(zip(map(str, sizes), map(int, place), strict=True))
    where = result.describe(point, [name for name in result.varying if name != SAMPLE])
    n_points = last["n_without_value"].size
    more = f" (of {n_points} points the one {why})" if n_points > 1 else ""
    return last.isel(point), (f", at {where}" if where else "") + more


def _deepest(result: Result, point: Point, at: int, where: str) -> Finding:
    """The deepest pair of a point, and whether most is worn at the edge of its surface."""

    def read(name: str, *index: int) -> float:
        return float(result.at(name, point, at).values[index]) if result.has(name) else math.nan

    if not has_depths(result):
        depth = read("largest_wear_depth")
        return Finding("deepest", "deepest", with_error(depth, math.nan, "m") + where, {"wear_depth": depth})
    depths = np.nan_to_num(last_depth(result, point), nan=0.0)
    pair, pairs, numbers = int(np.argmax(depths)), contact_pairs(result, point), result.dataset["contact"].values
    error = read("wear_depth_error", pair) if result.has("wear_depth_error") else read("wear_depth_max_error")
    surface = str(pairs.surface[pair]) if result.has("contact_surface") else ""
    number, place = int(numbers[pair]), pairs.position[pair].tolist()
    text = f"{with_error(depths[pair], error, 'm')} at contact pair {number}" + (f" of {surface}" if surface else "")
    if result.has("contact_sector"):
        text += f", sector {int(result.at('contact_sector', point).values[pair])}"
    if np.isfinite(place).all():
        text += f", (x, y, z) = ({', '.join(f'{1e3 * each:.4g}' for each in place)}) mm"
    begun = worn_before(result.study, "wear_depth", point.get(WORN_AXIS, 0))
    if begun.any():
        whole = depths + begun
        most = f"{show(float(whole.max()), 'm')} at pair {int(numbers[int(np.argmax(whole))])}"
        text += f", since the joint was mounted; {most} with the wear before"
    # mirror pairs, for one
    least = depths[pair] * (1.0 - LEAST_ERROR) - (error if error < SENSITIVE_ERROR * depths[pair] else 0.0)
    also = [int(number) for number in numbers[depths >= least] if number != numbers[pair]]
    if also:
        more = f" and {len(also) - _MOST_ALIKE} others" if len(also) > _MOST_ALIKE else ""
        text += f"; as deep within the error: pair {', '.join(map(str, also[:_MOST_ALIKE]))}{more}"
    text, share = text + where, math.nan
    if result.has("contact_surface", "contact_area", "contact_edge"):
        on_it = pairs.surface == surface
        edge = on_it & (result.at("contact_edge", point).values == 1)
        if edge.any() and depths[on_it].any():
            share, of_area = (each[edge].sum() / each[on_it].sum() for each in (depths * pairs.area, pairs.area))
            if share > max(_SHARE, of_area):
                text += f"; {show_percent(share)} of the wear of {surface} is in edge pairs:"
                text += " valid if the real contact ends there, else extend the model"
    values = {"wear_depth": float(depths[pair]), "error": error, "contact": number, "also": also, "surface": surface}
    return Finding("deepest", "deepest", text, values | {"position": place, "edge_share": float(share)})


def _nothing(result: Result, resonance: str) -> Finding:
    """Why no point whose worn volume is known wears."""
    slip, why, used = math.nan, "", math.nan
    if result.has("slip_range"):
        largest = result.over_points("slip_range", lambda values: np.nan_to_num(values).max(axis=-1))
        slip = float(largest[result.best_known].max())
        slip = slip if slip >= NO_MOTION else 0.0
        why = f": pairs slip by up to {show(slip, 'm')} without wear" if slip else ": all pairs stick"
    n_points, n_known = result.usable.size, int(np.count_nonzero(result.usable))
    where = f"at all {n_points} points" if n_points > 1 else f"at {where_is(result, result.shown)}"
    if n_known < n_points:
        where = f"at {n_known} of {count(n_points, 'point')}, the worn volume of the others is not known"
    if not slip and result.has("friction_use"):
        used = float(result.of_points("friction_use", 0)[result.best_known].max())
        if used > 1.0 - LEAST_ERROR:
            where += ", of which some have come to rest at the limit of friction"
        elif used > 0.0:
            where += f", with at most {show_percent(used)} of the friction that they can bear"
    text = f"nothing wore{why} {where}" + (f" ({resonance})" if resonance else "")
    values = {"worn_volume": 0.0, "largest_slip": slip, "friction_use": used}
    if not slip and result.has("slip_amplitude", "excitation_amplitude"):
        begins, said = _where_slip_begins(result)
        text, values["slip_amplitude"] = text + said, begins
    return Finding("wear", "wear", text, values)


def _where_slip_begins(result: Result) -> tuple[float, str]:
    """Excitation amplitude at which slip begins, N, as the point says that is nearest to it, and in words."""
    slips = result.dataset["slip_amplitude"]
    drawn = f"{DRAWN}excitation_amplitude"
    amplitude = result.dataset[drawn if drawn in result.dataset else "excitation_amplitude"]
    shares = (amplitude / slips.where(np.isfinite(slips))).transpose(*result.axes).values
    shares = np.where(result.best_known & np.isfinite(shares), shares, 0.0)
    nearest = result.largest(shares)
    share = float(shares[result.place(nearest)])
    if share == 0.0:
        return math.nan, ""
    begins = float(slips.values[result.place(nearest)])
    where = result.describe(nearest, [name for name in result.varying if name not in _AFTER_THE_START])
    text = f"; slip begins at about {show(begins, 'N')}" + (f" at {where}" if where else "")
    return begins, f"{text}, extrapolated from {show(share * begins, 'N')}"


# --- life, meshes ---


def _shortest_life(result: Result) -> Finding | None:
    """The shortest life of the points of a study with a target; None without a target."""
    until = result.study.get("slow_time", {}).get("until")
    if not isinstance(until, dict) or not result.has("cycles_to_target"):
        return None
    (quantity, target), *_ = until.items()
    ended = result.computed & ~result.ended(Outcome.SENSITIVE) & ~np.isinf(result.errors)
    lives, errors = (result.dataset[name].values for name in ("cycles_to_target", "cycles_to_target_error"))
    unknown = ended & (errors > SENSITIVE_ERROR * lives)
    n_beyond, n_unsure = int(np.count_nonzero(ended & np.isnan(lives))), int(np.count_nonzero(unknown))
    lives = np.where(ended & ~unknown, lives, np.nan)
    units = {"wear_depth": "m", "worn_volume": "m3"}.get(quantity, "1")
    reaches = f"{quantity.replace('_', ' ')} {show(target, units)}"
    unsure = f"the life of {count(n_unsure, 'point')} is not known" if n_unsure else ""
    values = {"target": target, "count": math.nan, "n_beyond": n_beyond, "n_unsure": n_unsure}
    if np.isnan(lives).all():
        none = f"no {'other ' if unsure else ''}point computed to the end reaches {reaches}"
        text = "; ".join(filter(None, ("" if unsure and not n_beyond else none, unsure)))
        return Finding("life", "life", text, values)
    point = result.largest(-np.nan_to_num(lives, nan=np.inf))
    life, error = (float(each[result.place(point)]) for each in (lives, errors))
    known = show_known(error / life if life > 0.0 else math.nan)
    text = f"{show_cycles(round(life), result.counted)}{known} to {reaches} at {where_is(result, point)}"
    text += f"; {unsure}" if unsure else ""
    text += f"; not reached by {count(n_beyond, 'point')}" if n_beyond else ""
    return Finding("life", "life", text, values | {"count": life, "error": error, "point": point})
