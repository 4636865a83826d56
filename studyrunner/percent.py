"""Relative errors in percent and cycle counts, as the last lines of a run, messages and the report show them."""

from __future__ import annotations

import math

_DIGITS = range(2, 13)
_SPACED = 1e4  # counts from here on have spaces between thousands


def show_percent(fraction: float, rtol: float | None = None) -> str:
    """A relative error in percent: "2.6 %"; more than ten times the whole in short.

    With `rtol`, the error that was asked for, it has as many digits as show on which side of `rtol` it is: an error
    just above 1 % is not shown as 1 %.
    """
    if fraction >= 1.0:
        return f"{100.0 * fraction:.0f} %" if fraction < 10.0 else f"{100.0 * fraction:.0e} %"
    shown = 100.0 * fraction
    limit = math.inf if rtol is None else float(f"{100.0 * rtol:.12g}")
    for digits in _DIGITS:
        shown = float(f"{100.0 * fraction:.{digits}g}")
        if rtol is None or (shown <= limit) == (fraction <= rtol):
            break
    return f"{shown:.12g} %"


def show_rtol(rtol: float) -> str:
    """The error that was asked for, as it was given: "1 %"."""
    return f"{100.0 * rtol:.6g} %"


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
        return text if cycle >= _SPACED else text.replace(" ", "")
    return f"{cycle:.6g}"
