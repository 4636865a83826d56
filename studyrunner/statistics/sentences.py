"""What samples say, or can say, in sentences."""

import math

import numpy as np
import xarray as xr

from studyrunner.scatter import ScatterSection
from studyrunner.statistics import samples
from studyrunner.statistics.read_samples import LIFE
from studyrunner.statistics.samples import FEWEST
from studyrunner.statistics.study_statistics import CONFIDENCE, QUANTILES, QUANTITIES
from studyrunner.system.progress import count
from studyrunner.units import show_number, show_percent

_MM3 = 1e9
_MEASURES = ("first_index", "rank_correlation")


def describe_volumes(point: xr.Dataset) -> str:
    """Range, median and numerical error of the worn volumes and depths of one point, and two groups where there are; of
    the lives where points end at a target.
    """
    probabilities, n_without = point["quantile"].values, int(point["n_without_value"])
    of = f"{100.0 * (probabilities[-1] - probabilities[0]):.4g} % of {count_samples(point)}"
    if f"{LIFE}_quantile" in point:
        return f"{of} last {_describe_spread(point, LIFE)}"
    text = f"{of} wear {_describe_spread(point, 'worn_volume')}"
    text += f"; {n_without} have no volume that can be trusted" if n_without else ""
    text += f"; deepest pair {_describe_spread(point, 'wear_depth')}" if "wear_depth_quantile" in point else ""
    (n_lower, n_upper), (lower, upper) = point["group_size"].values.tolist(), point["group_gap"].values * _MM3
    if n_upper:
        text += f"; two groups, {n_lower} samples up to {lower:.3g} mm3 and {n_upper} from {upper:.3g} mm3"
        contact = int(point["deciding_contact"])
        text += "" if contact < 0 else f", which differ in the wear depth of contact pair {contact}"
    return text


def count_samples(point: xr.Dataset) -> str:
    """How many samples there are, and that others are not computed yet."""
    n_samples, n_left = int(point["n_samples"]), int(point["n_not_computed"])
    return f"{n_samples} computed samples ({n_left} not computed)" if n_left else count(n_samples, "sample")


def _describe_spread(point: xr.Dataset, name: str) -> str:
    factor, unit = QUANTITIES[name].factor, QUANTITIES[name].shown
    ends, error = (point[f"{name}_{each}"].values * factor for each in ("quantile", "quantile_error"))
    text, is_middle = f"{_range(ends[0, 0], ends[-1, 1])} {unit}", point["quantile"].values == 0.5
    for middle, moved in zip(ends[is_middle], error[is_middle], strict=True):
        # how far the ends move, apart from what samples without a value may have
        finite = np.isfinite(middle)
        by = np.abs(moved[finite] - middle[finite])
        relative = float(by.sum() / middle[finite].sum()) if by.any() else 0.0
        shown = show_percent(relative) if finite.any() and math.isfinite(relative) else "not known"
        text += f", median {_range(*middle)} {unit} (numerical error {shown})"
    return text


def describe_limit(point: xr.Dataset, name: str) -> str:
    """Probability of the limit of one point, its interval, and how many samples are known to be within it, and to be
    on no side. name: of `QUANTITIES`.
    """
    n_samples, quantity = int(point["n_samples"]), QUANTITIES[name]
    ends, interval = (100.0 * point[f"{name}_within_limit{each}"].values for each in ("", "_interval"))
    side, words = ("at least", "life") if quantity.at_least else ("at most", name.replace("_", " "))
    limit = show_number(point[f"{name}_limit"].item() * quantity.factor, 4)
    n_unknown = int(point[f"{name}_not_placed"])
    found = f"{round(n_samples * ends[0] / 100.0)} of {count_samples(point)}"
    within = f"{100.0 * point.attrs['confidence']:g} % interval {_range(*interval)} %"
    # a range of estimates beside the interval, which contains it, would be one too many
    found = (
        f"{found}, {n_unknown} not known, {within}" if n_unknown else f"{ends[0]:.3g} % probable ({within}), {found}"
    )
    return f"{words} {side} {limit} {quantity.shown}: {found}"


def what_samples_tell(section: ScatterSection) -> str:
    """What so many samples can answer, before any is computed: ranks, tails, the interval of a probability."""

    def half_width(samples_asked: int) -> float:
        n = independent * samples_asked
        return 50.0 * float(np.ptp(samples.probability_interval(n // 2, n, CONFIDENCE)))

    independent, n, tail = 2 if section.method == "saltelli" else 1, section.samples, QUANTILES[0]
    # such that both ends of the interval of the quantile lie between samples
    needed = math.ceil(math.log(0.5 - 0.5 * CONFIDENCE) / math.log(1.0 - tail) / independent)
    of_tails = f"quantiles of {100.0 * tail:g} and {100.0 - 100.0 * tail:g} %"
    answers = ((FEWEST, "ranking of inputs"), (needed, of_tails))
    texts = [words if n >= fewest else f"no {words} (from {fewest} on)" for fewest, words in answers]
    known = f"a probability is known to ± {half_width(n):.2g} %, with {8 * n} to ± {half_width(8 * n):.2g} %"
    return f"{n} by {section.method}: {', '.join(texts)}; {known}, or better where nearly all or none are below a limit"


def _range(low: float, high: float, digits: str = "") -> str:
    first, last = (f"{each:{digits}}" if digits else show_number(each, 3) for each in (low, high))
    return f"above {first}" if math.isinf(high) else first if first == last else f"{first} to {last}"


def measure_of(statistics: xr.Dataset) -> str | None:
    """Name of the statistic by which the inputs are ranked; None where there is none."""
    return next((name for name in _MEASURES if name in statistics), None)


def describe_ranking(point: xr.Dataset) -> str:
    """The deciding input in words, or why none is known; "" where no input varies.

    One decides where the interval of its strength, a correlation without sign, is above those of all others.
    """
    name = measure_of(point)
    if name is None:
        return ""
    n_samples, words = int(point["n_samples"]), [str(each).replace("_", " ") for each in point["input"].values]
    values, intervals = (point[f"{name}{each}"].transpose("input", "bound").values for each in ("", "_interval"))
    if np.isnan(values).all():
        # two independent samples for each base sample
        too_few = n_samples < FEWEST * (2 if name == "first_index" else 1)
        return f"{n_samples} samples are too few to say which input decides" if too_few else ""
    without = ", ".join(word for word, row in zip(words, values, strict=True) if np.isnan(row).all())
    more = f"; not ranked: {without}" if without else ""
    most = int(np.argmax(np.abs(np.nan_to_num(values)).max(axis=1)))
    (low, high), (lowest, highest) = intervals[most], values[most].tolist()
    if name == "first_index":
        share = _range(100.0 * lowest, 100.0 * highest, ".0f")
        shown = f"{share} % of the variance, interval {100.0 * low:.0f} to {100.0 * high:.0f} %"
    else:
        shown = f"rank correlation {_range(lowest, highest, '.2f')}, interval {low:.2f} to {high:.2f}"
    others = np.abs(np.nan_to_num(np.delete(intervals, most, axis=0))).max(initial=0.0)
    if low < 0.0 < high or min(abs(low), abs(high)) <= others:
        return f"which input decides is not known: {words[most]} has the largest estimate ({shown}){more}"
    return f"{words[most]} decides most ({shown}){more}"
