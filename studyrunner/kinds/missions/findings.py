"""What came out of missions: as of wear histories, and the share of each block."""

from collections.abc import Iterator
from typing import Any

from studyrunner.kinds.wear import findings as of_histories
from studyrunner.result.view import Result
from studyrunner.summary.findings import Finding
from studyrunner.units import show_percent

errors_of = of_histories.errors_of


def what_came_out(result: Result, stuck: float) -> Iterator[Finding]:
    """Wear, the blocks that wear, life, meshes. stuck: first frequency with the joint stuck, Hz, or NaN."""
    most: dict[str, Any] = {}
    for each in of_histories.what_came_out(result, stuck):
        yield each
        most |= each.values if each.name == "wear" else {}
        if each.name == "deepest" and result.blocks is not None and "block_worn_volume" in result.blocks:
            point = most["point"]
            worn = result.blocks["block_worn_volume"].isel(point).isel(cycle=result.last_reached(point))
            shares = dict(zip(worn["block"].values.tolist(), (worn.values / most["worn_volume"]).tolist(), strict=True))
            text = ", ".join(f"{name} {show_percent(share)}" for name, share in shares.items())
            yield Finding("blocks", "blocks", f"share of the wear: {text}", shares)
