"""Relative errors in percent, as the last lines of a run, messages and the report show them."""

from __future__ import annotations

import math

_DIGITS = range(2, 13)


def show_percent(fraction: float, rtol: float | None = None) -> str:
    """A relative error in percent: "2.6 %"; more than ten times the whole in short.

    With `rtol`, what it is held against, it has as many digits as it takes to stand on the right side of it: an error
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
