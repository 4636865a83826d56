"""What came out for the sectors of a ring: which wears most, and which vibrates most."""

from typing import Any

import numpy as np

from solver.model import FloatArray
from studyrunner.result.view import NO_MOTION, NO_VOLUME, Result
from studyrunner.summary.findings import Finding, show
from studyrunner.units import show_percent

_ALIKE = 5e-3
"""Difference of sectors over the largest one below which they are alike: three digits are shown."""


def describe_ring(result: Result) -> Finding | None:
    """The sector that wears most, and the one that vibrates most, of the shown point; None of other results."""
    if not result.has("sector_worn_volume"):
        return None
    point, texts, values = result.shown, list[str](), dict[str, Any]()
    last = result.last_reached(point)
    worn = np.nan_to_num(result.at("sector_worn_volume", point, last).values)
    if worn.max() > NO_VOLUME:
        most, least = int(worn.argmax()), int(worn.argmin())
        values |= {"wears_most": most, "worn_volume": worn.tolist()}
        share = show_percent(float(worn[most] / worn.sum()))
        texts.append(
            f"all sectors wear alike, {show(worn[most], 'm3')}"
            if _alike(worn)
            else f"sector {most} wears most, {show(worn[most], 'm3')}, {share} of all; "
            f"least sector {least}, {show(worn[least], 'm3')}"
        )
    before = ""
    if result.has("sector_amplitude"):
        both = np.nan_to_num(result.at("sector_amplitude", point, [0, last]).values)
        for amplitude, when in zip(both, ("new", "worn") if texts else ("new",), strict=False):
            if amplitude.max() > NO_MOTION:
                most, factor = int(amplitude.argmax()), float(amplitude.max() / amplitude.mean())
                who, said = f"sector {most} vibrates most, ", f"{when} {show(amplitude[most], 'm')}"
                if _alike(amplitude):
                    who = "all sectors vibrate alike, "
                else:
                    said += f", {factor:.3g} times the mean of all"
                texts.append(said if who == before else who + said)
                before = who
                values |= {f"vibrates_most_{when}": most, f"magnification_{when}": factor}
    return Finding("ring", "ring", "; ".join(texts), values) if texts else None


def _alike(values: FloatArray) -> bool:
    """Whether values (n_sectors,) are those of equal sectors."""
    return bool(np.ptp(values) < _ALIKE * values.max())
