"""What came out for the sectors of a ring: which wears most, and which vibrates most."""

from typing import Any

import numpy as np

from studyrunner.result.view import NO_MOTION, NO_VOLUME, Result
from studyrunner.summary.findings import Finding, show
from studyrunner.units import show_percent


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
            f"sector {most} wears most, {show(worn[most], 'm3')}, {share} of all; "
            f"least sector {least}, {show(worn[least], 'm3')}"
        )
    if result.has("sector_amplitude"):
        both = np.nan_to_num(result.at("sector_amplitude", point, [0, last]).values)
        for amplitude, when in zip(both, ("new", "worn") if texts else ("new",), strict=False):
            if amplitude.max() > NO_MOTION:
                most, factor = int(amplitude.argmax()), float(amplitude.max() / amplitude.mean())
                said = f"{when} {show(amplitude[most], 'm')}, {factor:.3g} times the mean of all"
                again = most == values.get("vibrates_most_new")
                texts.append(said if again else f"sector {most} vibrates most, {said}")
                values |= {f"vibrates_most_{when}": most, f"magnification_{when}": factor}
    return Finding("ring", "ring", "; ".join(texts), values) if texts else None
