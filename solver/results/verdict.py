"""The outcome of a wear history and its sentence, for the history itself and for histories that are read from it."""

from __future__ import annotations

import math

import numpy as np

from solver.model import ContactInterface, FloatArray, IntArray
from solver.outcome import SENSITIVE_ERROR, Outcome, in_digits, known_to
from solver.results.history import WearHistory
from solver.settings import NEGLIGIBLE

HELD_FORCE = 1e-5
"""Fraction of the friction of all pairs that a hold of the mean position takes up at most. Motion and wear change by
this fraction at most, far below any rtol. Dovetail, friction 0.3, 1 N: 5e-7 to 2e-6 after 20 000 cycles."""


def judge(history: WearHistory, rows: IntArray, rtol: float, slower: float = 1.0) -> tuple[Outcome, str]:
    """Outcome of a complete history, judged at some of its counts, and a sentence about the outcome.

    rows: indices of the judged counts, ascending: all counts, or those of another history that is read from this one.
    rtol: wanted relative error. slower: ratio of the wear coefficients of the other and the integrated history: counts
    of the integrated history are so many times larger.
    """
    if not rows.size:
        return Outcome.CONVERGED, ""
    last = int(rows[-1])
    if history.cycles[last] >= history.cut_off_cycle:
        return Outcome.CONTACT_CUT_OFF, describe_cut_off(history.cut_off_cycle / slower)
    outcome, said = Outcome.CONVERGED, []
    error = float(history.worn_volume_error[last])
    if error > SENSITIVE_ERROR:
        volumes = float(history.worn_volume[last]), float(history.reference_volume[last])
        coarser = "with longer steps, fewer harmonics and a coarser sweep"
        outcome, said = Outcome.SENSITIVE, [describe_uncertain(*volumes, error, rtol, coarser)]
    # inf means "never", but is the count of a final state, too
    elif math.inf > history.inaccurate_from <= history.cycles[last]:
        begin = f"from cycle {history.inaccurate_from / slower:,.0f} on ".replace(",", " ")
        said = [begin + f"the {history.inaccurate_in} {known_to(history.inaccurate_error, rtol)}"]
        outcome = Outcome.INACCURATE
    if math.inf > history.held_from <= history.cycles[last]:
        said.append(
            f"from cycle {in_digits(history.held_from / slower)} on every pair slips and only friction holds the joint"
            f" in one direction: its mean position is held there, by at most {HELD_FORCE:g} of the friction"
        )
    return outcome, "; ".join(said)


def last_error(history: WearHistory, rows: IntArray, last: float) -> float:
    """Estimated relative error of the last worn volume of a history; NaN where there is none, as where a history
    reaches its target before its first count. rows: indices of the counts reached. last: count that was computed.
    """
    if not rows.size or (history.cycles[rows[-1]] == 0.0 and last > 0.0 and bool(history.wear_rate[rows[-1]] > 0.0)):
        return math.nan
    return float(history.worn_volume_error[rows[-1]])


def describe_uncertain(volume: float, other: float, error: float, rtol: float, coarser: str) -> str:
    """Sentence about an uncertain worn volume, m3, beside that of a solution `coarser`, NaN where that ended before."""
    known = known_to(error, rtol).removeprefix("is ") if error < 1.0 else "not known"
    own, its = f"worn volume {1e9 * volume:.3g} mm3", f"{1e9 * other:.3g} mm3 {coarser}"
    if not math.isfinite(other):
        return f"{own}, {known}: {coarser} the history does not go so far"
    if abs(volume - other) < 0.5 * error * volume:
        return f"{own}, {known}: {its}, but worn at other pairs or counts"
    return f"{own}, but {its}: {known}"


def first_cut_off(contact: ContactInterface, cycles: FloatArray, pressure: FloatArray, depth: FloatArray) -> float:
    """First of the counts (n_output,) at which a pair at an edge of the modelled contact carries load or has worn, NaN
    if never. pressure, depth (n_output, n_contact): Pa and m, NaN without a state.
    """
    if contact.edge is None or not contact.edge.any():
        return math.nan
    reached = [values[:, contact.edge].max(axis=1) > NEGLIGIBLE * values.max(axis=1) for values in (pressure, depth)]
    found = np.flatnonzero(np.logical_or(*reached))
    return float(cycles[found[0]]) if found.size else math.nan


def describe_cut_off(count: float, of: str = "cycle") -> str:
    """Sentence with the first count of a cut off contact."""
    when = f"at {of} {in_digits(count)}" + (" already" if count else "")
    return f"pairs at the edge of the modelled contact carry load or have worn {when}"
