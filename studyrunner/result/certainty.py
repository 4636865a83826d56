"""How well the numbers of a file are known, how points ended, and what to do about both."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studyrunner.result.view import WELL_ENOUGH, Point, Result
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


@dataclass(frozen=True)
class Certainty:
    """How well the numbers of a result are known. n_known, n_less, n_unknown: of points computed to the end."""

    of: str  # what, as "worn volume"
    n_points: int  # of the study
    n_known: int  # known to rtol
    n_less: int
    n_unknown: int  # never estimated
    rtol: float  # NaN where it is an axis
    worst: float  # largest relative error, NaN without one
    where: str  # its point in words
    advice: str  # what would make it smaller; empty where all are known to rtol

    @property
    def n_short(self) -> int:
        """Points that were not computed to the end."""
        return self.n_points - self.n_known - self.n_less - self.n_unknown

    @property
    def sentence(self) -> str:
        """The certainty in one sentence."""
        rtol = self.rtol if math.isfinite(self.rtol) else None
        aim = "their rtol" if rtol is None else f"rtol = {show_rtol(rtol)}"
        worst = self.worst if rtol is not None and rtol < _LEAST else max(self.worst, _LEAST)
        known = f"known within {show_percent(worst, rtol)}" if worst <= WELL_ENOUGH else "not known"
        if self.n_points == 1:
            if self.n_short:
                return f"the {self.of} is not known: the point was not computed to the end"
            return f"the {self.of} is {known} ({aim})" + (f": {self.advice}" if self.advice else "")
        text = f"{self.n_known} of {count(self.n_points, self.of)} are known within {aim}"
        text += f", {self.n_less} less well" if self.n_short and self.n_less else ""
        text += f", {self.n_short} not computed to the end" if self.n_short else ""
        text += f", {self.n_unknown} without an estimate" if self.n_unknown else ""
        if not self.worst > 0.0:
            return text
        where, advice = (f"{self.where}, " if self.where else ""), (f"; {self.advice}" if self.advice else "")
        return f"{text}; least certain: {where}{known.removeprefix('known ')}{advice}"


def certainty_of(result: Result, *, wore: bool = True) -> Certainty | None:
    """How well worn volumes, or where nothing wore responses, or modes are known; None where the file has no errors."""
    if result.has_modes:
        return _certainty(result, "point", _errors_of_modes(result))
    responses = result.has("response_error") and result.blocks is None
    has_errors = result.has("error_estimate") and np.isfinite(result.rtol).any() and result.computed.any()
    if result.wears and has_errors and (wore or not responses):
        return _certainty(result, "worn volume", result.errors)
    if responses:
        last = result.dataset["response_error"].isel(cycle=-1).transpose(*result.axes).values
        return _certainty(result, "response", last)
    return None


def _errors_of_modes(result: Result) -> NDArray[np.float64]:
    """Largest relative error of natural frequency and damping ratio; in the shape of the axes."""
    errors = np.zeros(result.computed.shape)
    for name in ("natural_frequency", "damping_ratio"):
        if result.has(name, f"{name}_error"):
            value, error = np.abs(result.dataset[name].values), result.dataset[f"{name}_error"].values
            errors = np.fmax(errors, np.where(value > 0.0, error / np.where(value > 0.0, value, 1.0), 0.0))
    return errors


def _certainty(result: Result, of: str, errors: NDArray[np.float64]) -> Certainty:
    known = result.computed & np.isfinite(errors)
    # each is compared with its own rtol: one that is above it is worse than any that is not
    above = result.computed & (errors > result.rtol)
    several = np.unique(result.rtol[np.isfinite(result.rtol)])
    n_unknown = int(np.count_nonzero(result.computed & np.isnan(errors)))
    worst, where, advice = math.nan, "", ""
    if above.any() or known.any():
        point = result.largest(np.where(above if above.any() else known, errors, -1.0))
        place = result.place(point)
        worst, where = float(errors[place]), result.describe(point) if result.varying else ""
        if above.any():
            found = _advise_error(result, place, worst) if of == "worn volume" else "set a smaller solver.rtol"
            advice = f"for {show_rtol(float(result.rtol[place]))} {found}"
    n_known, n_less = (int(np.count_nonzero(each)) for each in (known & ~above, above))
    rtol = float(several[0]) if several.size == 1 else math.nan
    return Certainty(of, errors.size, n_known, n_less, n_unknown, rtol, worst, where, advice)


def show_error(result: Result, point: Point) -> str:
    """Error of the worn volume of a point as text: "2.6 %"."""
    place = result.place(point)
    return show_percent(float(result.errors[place]), float(result.rtol[place]))


# --- points that ended otherwise ---


def first_ended(result: Result, number: int) -> tuple[dict[str, int], str]:
    """The first point that ended in this way, and what is to be said of it beside the outcome, which may be nothing."""
    place = tuple(np.argwhere(result.dataset["outcome"].values == number)[0].tolist())
    point, said = result.point_at(place), str(result.dataset["message"].values[place]) if result.has("message") else ""
    if result.has_values[place] and result.counted[:-1] not in said:
        last = show_cycles(float(result.last_cycle[place]), result.counted)
        end = "" if result.computed[place] else f"computed up to {last}"
        is_known = 0.0 < result.errors[place] <= WELL_ENOUGH
        known = f"worn volume known within {show_error(result, point)}" if is_known else ""
        said = ", ".join(filter(None, (end, known, said)))
    return point, said


def _advise_error(result: Result, place: tuple[int, ...], error: float) -> str:
    """What would make the error of a worn volume smaller, in a few words. error: relative, above `rtol`."""
    scheme, rtol = "adaptive", float(result.rtol[place])
    if "scheme" in result.axes:
        scheme = str(result.dataset["scheme"].values[place[result.axes.index("scheme")]])
    if scheme not in _OWN_STEPS:
        return 'set scheme = "adaptive" or a smaller step'
    if error >= _FAR * rtol:
        return "set a smaller solver.rtol"
    # steps, harmonics and the walk to the start state all go by rtol: what comes out is about as many times smaller
    digits, exponent = f"{rtol**2 / error:.12e}".split("e")
    return f"set solver.rtol = {float(f'{digits[:3]}e{exponent}'):g}"
