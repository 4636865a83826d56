"""How well the numbers of a result are known, how points ended, and what to do about both."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from studyrunner.result.view import WELL_ENOUGH, Result
from studyrunner.summary.findings import Finding
from studyrunner.system.progress import count
from studyrunner.units import show_cycles, show_percent, show_rtol

_LEAST = 1e-4  # relative error that is shown, of any smaller one
_OWN_STEPS = ("adaptive", "final")

_FAR = 10.0
"""Errors of more than so many times `rtol` do not fall in proportion to it."""

_AUTOMATIC = 'harmonics and samples of "auto", where numbers are given'
ADVICE = {
    "time_limit": "--retry-failed continues with a larger solver.time_limit",
    "resonance_lost": "Try another range in loading.between, or another axes.sweep",
    "start_failed": f"Try another axes.sweep, or {_AUTOMATIC}",
    "branch_lost": f"Try another axes.sweep, or {_AUTOMATIC}",
    "unstable": "Try another axes.sweep",
    "march_failed": f"Try a smaller solver.rtol or step, or {_AUTOMATIC}",
    "step_too_long": 'Try scheme = "adaptive", or a smaller step',
    "sensitive": "Try a smaller solver.rtol or step; where that fails, the joint is that sensitive: use [scatter]",
    "inaccurate": f"Try {_AUTOMATIC}",
    "certificate_failed": f"Try a smaller solver.tolerance, or {_AUTOMATIC}",
    "no_final_state": "Try an end in slow_time.cycles or slow_time.until",
}
"""What may help, by outcome."""


def certainty_of(result: Result, *, wore: bool = True) -> Finding | None:
    """How well worn volumes, or where nothing wore responses, or modes are known; None where the file has no errors.

    Values: n_known to rtol, n_less and n_unknown, never estimated, of the points computed to the end; worst: the
    largest relative error, NaN without one; rtol: NaN where it is an axis.
    """
    responses = result.has("response_error") and result.blocks is None
    has_errors = result.has("error_estimate") and np.isfinite(result.rtol).any() and result.computed.any()
    if result.has_modes:
        of, errors = "point", _errors_of_modes(result)
    elif result.wears and has_errors and (wore or not responses):
        of, errors = "worn volume", result.errors
    elif responses:
        of, errors = "response", result.dataset["response_error"].isel(cycle=-1).transpose(*result.axes).values
    else:
        return None
    known, above = result.computed & np.isfinite(errors), result.computed & (errors > result.rtol)
    masks = {"n_known": known & ~above, "n_less": above, "n_unknown": result.computed & np.isnan(errors)}
    values = {name: int(np.count_nonzero(mask)) for name, mask in masks.items()}
    several = np.unique(result.rtol[np.isfinite(result.rtol)])
    rtol = float(several[0]) if several.size == 1 else None
    worst, where, advice = math.nan, "", ""
    if above.any() or known.any():
        # each is compared with its own rtol: one that is above it is worse than any that is not
        point = result.largest(np.where(above if above.any() else known, errors, -1.0))
        worst, where = float(errors[result.place(point)]), result.describe(point) if result.varying else ""
        if above.any():
            advice = _advise_error(result, result.place(point), worst) if of == "worn volume" else "a smaller rtol"
    found = {"of": of, "rtol": math.nan if rtol is None else rtol, "worst": worst, "where": where, "advice": advice}
    return Finding("certainty", "certainty", _sentence(result, of, values, rtol, worst, where, advice), values | found)


def _sentence(
    result: Result, of: str, numbers: dict[str, int], rtol: float | None, worst: float, where: str, advice: str
) -> str:
    aim, shown = "their rtol" if rtol is None else f"rtol = {show_rtol(rtol)}", max(worst, _LEAST)
    shown = worst if rtol is not None and rtol < _LEAST else shown
    within = f"within {show_percent(shown, rtol)}" if shown <= WELL_ENOUGH else "not known"
    n_points, (n_known, n_less, n_unknown) = result.computed.size, numbers.values()
    n_short = n_points - n_known - n_less - n_unknown
    advice = f": set {advice}" if advice else ""
    if n_points == 1:
        if n_short:
            return f"the {of} is not known: the point was not computed to the end"
        return f"the {of} is {within.replace('within', 'known within')} ({aim}){advice}"
    text = f"{n_known} of {count(n_points, of)} are known within {aim}"
    text += f", {n_less} less well" if n_short and n_less else ""
    text += f", {n_short} not computed to the end" if n_short else ""
    text += f", {n_unknown} without an estimate" if n_unknown else ""
    return f"{text}; least certain: {', '.join(filter(None, (where, within)))}{advice}" if worst > 0.0 else text


def _errors_of_modes(result: Result) -> NDArray[np.float64]:
    """Largest relative error of natural frequency and damping ratio; in the shape of the axes."""
    errors = np.zeros(result.computed.shape)
    for name in ("natural_frequency", "damping_ratio"):
        if result.has(name, f"{name}_error"):
            value, error = np.abs(result.dataset[name].values), result.dataset[f"{name}_error"].values
            errors = np.fmax(errors, np.where(value > 0.0, error / np.where(value > 0.0, value, 1.0), 0.0))
    return errors


def _advise_error(result: Result, place: tuple[int, ...], error: float) -> str:
    """What to set so that the error of a worn volume is smaller. error: relative, above `rtol`."""
    scheme, rtol = "adaptive", float(result.rtol[place])
    if "scheme" in result.axes:
        scheme = str(result.dataset["scheme"].values[place[result.axes.index("scheme")]])
    if scheme not in _OWN_STEPS:
        by_depth = scheme == "explicit" and "largest_depth" in result.study.get("slow_time", {})
        return f'scheme = "adaptive" or a smaller {"slow_time.largest_depth" if by_depth else "step"}'
    if error >= _FAR * rtol:
        return "a smaller solver.rtol"
    # steps, harmonics and the walk to the start state all go by rtol: what comes out is about as many times smaller
    digits, exponent = f"{rtol**2 / error:.12e}".split("e")
    return f"solver.rtol = {float(f'{digits[:3]}e{exponent}'):g}"


def first_ended(result: Result, number: int) -> tuple[dict[str, int], str]:
    """The first point that ended in this way, and what is to be said of it beside the outcome, which may be nothing."""
    place = tuple(np.argwhere(result.dataset["outcome"].values == number)[0].tolist())
    point, said = result.point_at(place), str(result.dataset["message"].values[place]) if result.has("message") else ""
    if result.has_values[place] and result.counted[:-1] not in said:
        last = show_cycles(float(result.last_cycle[place]), result.counted)
        end = "" if result.computed[place] else f"computed up to {last}"
        is_known = 0.0 < result.errors[place] <= WELL_ENOUGH
        known = f"worn volume known within {result.show_error(point)}" if is_known else ""
        said = ", ".join(filter(None, (end, known, said)))
    return point, said
