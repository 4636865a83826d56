"""How points end: numbers, words and sentences of the variable `outcome`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr


@dataclass(frozen=True)
class Ending:
    """One outcome: number and word of the file, sentence for the reader."""

    number: int
    word: str
    sentence: str


def read_endings(outcome: xr.DataArray) -> dict[int, Ending]:
    """All ways for a point to end that the file names, by number."""
    attributes = outcome.attrs
    numbers = np.atleast_1d(attributes.get("flag_values", ())).tolist()
    words = str(attributes.get("flag_meanings", "")).split()
    # versions before 0.5 said so of every point that was computed to the end
    claimed = str(attributes.get("sentences", "")).replace("computed to tolerance", "computed to the end")
    sentences = claimed.splitlines()
    sentences += [""] * (len(words) - len(sentences))
    named = {
        int(number): Ending(int(number), word, sentence or word.replace("_", " "))
        for number, word, sentence in zip(numbers, words, sentences, strict=False)
    }
    # A number without a name is told as it is rather than left out.
    for number in np.unique(outcome.values).tolist():
        named.setdefault(int(number), Ending(int(number), f"outcome_{number}", f"outcome {number}"))
    return named
