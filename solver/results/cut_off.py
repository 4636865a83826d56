"""Detection of a cut off contact: pressure or wear at an edge of the modelled pairs at which the bodies go on."""

from __future__ import annotations

import math

import numpy as np

from solver.model import ContactInterface, FloatArray
from solver.outcome import in_digits
from solver.settings import NEGLIGIBLE


def first_cut_off(contact: ContactInterface, cycles: FloatArray, pressure: FloatArray, depth: FloatArray) -> float:
    """First count at which a pair at an edge of the modelled contact carries load or has worn, NaN if never.

    cycles (n_output,). pressure, depth (n_output, n_contact): Pa and m, NaN at counts without a state.
    """
    if contact.edge is None or not contact.edge.any():
        return math.nan
    reached = [values[:, contact.edge].max(axis=1) > NEGLIGIBLE * values.max(axis=1) for values in (pressure, depth)]
    found = np.flatnonzero(np.logical_or(*reached))
    return float(cycles[found[0]]) if found.size else math.nan


def describe_cut_off(cycle: float) -> str:
    """Sentence with the first count of a cut off contact."""
    when = f"at cycle {in_digits(cycle)}" + (" already" if cycle else "")
    return f"pairs at the edge of the modelled contact carry load or have worn {when}"
