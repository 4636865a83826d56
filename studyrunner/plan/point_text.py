"""Cycle counts in words, and how far a point came, for messages of points."""

from __future__ import annotations

import math

from studyrunner.percent import show_percent

_SHORT = 1e4


def describe_reach(last: float, end: float, error: float, counted: str = "cycle") -> str:
    """How far a history was computed that ends early, and the relative error of the last worn volume that is known.

    end: count that was asked for, inf where there is none. counted: what is counted, "cycle" or "mission".
    """
    reached = f"computed up to {counted} {show_count(last)}" + (f" of {show_count(end)}" if end < math.inf else "")
    # before the first count that was asked for nothing has worn, and that is known exactly
    known = last > 0.0 and 0.0 < error < math.inf
    return f"{reached}, the worn volume there to {show_percent(error)}" if known else reached


def show_count(cycle: float) -> str:
    """A cycle count: "31 000"; one that is no whole number, or very large, in short."""
    if cycle < 1e12 and cycle == round(cycle):
        text = f"{cycle:,.0f}".replace(",", " ")
        return text if cycle >= _SHORT else text.replace(" ", "")
    return f"{cycle:.6g}"
