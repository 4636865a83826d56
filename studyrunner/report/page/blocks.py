"""What the page holds of the blocks of missions: their responses at begin and end, over the missions."""

from __future__ import annotations

import math

from studyrunner.report.page.kept import Kept, encode_values, inner_shape, read_kept
from studyrunner.report.reading.result import Result

_OF_BLOCKS = ("response_amplitude", "response_amplitude_begin", "response_error")


def n_block_numbers(result: Result) -> int:
    """Numbers of a point in one mission; 0 of a result without missions."""
    if result.blocks is None:
        return 0
    return sum(math.prod(inner_shape(result.blocks[name])[1:]) for name in _OF_BLOCKS if name in result.blocks)


def build_block_numbers(result: Result, kept: Kept) -> dict[str, object] | None:
    """Names of the blocks, and their `variables` (point, cycle, block, response); None where there are no responses.

    The error has no response.
    """
    blocks = result.blocks
    if blocks is None or "response_amplitude" not in blocks:
        return None
    found = {name: blocks[name] for name in _OF_BLOCKS if name in blocks}
    return {
        "names": [str(name) for name in blocks["block"].values],
        "variables": {name: encode_values(values, read_kept(values, kept)) for name, values in found.items()},
    }
