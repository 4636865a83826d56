"""What of a study is hardly what was meant: a unit that was mixed up, a load that moves nothing. Never a refusal.

Each remark is one line; a run prints it on stderr, and the result keeps it in the attribute `plausibility`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from solver.outcome import COMPLETE
from studyrunner.plan.sharing import Index
from studyrunner.scene.scene import SceneFacts
from studyrunner.study.study import Study

METALS = (1.9e-14, 4e-13)
"""Wear coefficients of metals that were measured, 1/Pa: steel (McColl, Ding and Leen, Wear 256 (2004) 1114: 1.9e-8 and
2.9e-8 1/MPa; 52100: 4.2e-5 mm3/J), Ti-6Al-4V (4e-4 mm3/J). Energy coefficients are Archard's over the friction
coefficient, which is little beside the factor that is allowed."""

FAR = 1e3
"""Factor from which on a wear coefficient is far off."""

_UNITS = {"1/MPa or mm2/N": 1e-6, "mm3/(N m) or mm3/J": 1e-9}
"""What else wear coefficients are given in, and how much of 1/Pa it is."""


def doubts_of_study(study: Study) -> tuple[str, ...]:
    """Lines on wear coefficients that no metal has, before anything is computed; the one farthest off speaks for all.

    With a wear table it is the coefficient times the factors of the table.
    """
    table = study.wear_law.table
    factors = [1.0] if table is None else [factor for row in table.factor for factor in row if factor > 0.0]
    values = [value * factor for value in study.axes.wear_coefficient if value > 0.0 for factor in factors]
    off = [value for value in values if not METALS[0] / FAR <= value <= METALS[1] * FAR]
    if not off:
        return ()
    worst = max(off, key=_distance)
    what = "wear_coefficient" if table is None else "wear_coefficient times wear.factor"
    measured = f"metals have {METALS[0]:.2g} to {METALS[1]:.2g} 1/Pa"
    if worst < METALS[0]:
        return (f"{what} {worst:.3g} 1/Pa is {METALS[0] / worst:.1g} times below what was measured: {measured}",)
    units = [
        f"in {name} (then it is {worst * factor:.3g} 1/Pa)"
        for name, factor in _UNITS.items()
        if METALS[0] / FAR <= worst * factor <= METALS[1] * FAR
    ]
    asked = f": is it {' or '.join(units)}?" if units else ":"
    return (f"{what} {worst:.3g} 1/Pa is {worst / METALS[1]:.1g} times above what was measured{asked} {measured}",)


def _distance(value: float) -> float:
    """How far a wear coefficient is from those of metals, as the logarithm of a factor."""
    return max(math.log(METALS[0]) - math.log(value), math.log(value) - math.log(METALS[1]))


class Doubts:
    """Collects from records of histories what the loads of a study do; their order does not matter."""

    def __init__(self, study: Study, facts: SceneFacts) -> None:
        self._study = study
        names = list(study.dimensions)
        self._amplitude = names.index("excitation_amplitude")
        self._static = facts.static_response
        self._n_complete = 0
        n_amplitudes = len(study.axes.excitation_amplitude)
        self._wears = np.zeros(n_amplitudes, np.bool_)
        self._could_wear = any(value > 0.0 for value in study.axes.wear_coefficient)
        self._above_static = self._static is None or not bool(np.any(self._static > 0.0))

    def add(self, points: Sequence[tuple[Index, ...]], records: NDArray[np.void]) -> None:
        """Records (n,) as in `records`, and the points that each of them is of."""
        names = records.dtype.names or ()
        complete = np.isin(records["outcome"], list(COMPLETE))
        wears = records["largest_wear_depth"] > 0.0
        if "wear_rate" in names:
            wears = wears | (records["wear_rate"] > 0.0).any(axis=1)
        amplitudes = np.array(self._study.axes.excitation_amplitude)
        for row, of_one in enumerate(points):
            self._n_complete += len(of_one) if complete[row] else 0
            if wears[row]:
                self._wears[[point[self._amplitude] for point in of_one]] = True
        if self._above_static or "response_amplitude" not in names:
            self._above_static = True
            return
        assert self._static is not None
        # points that share a history have the same excitation
        excited = amplitudes[[of_one[0][self._amplitude] for of_one in points]]
        static = excited[:, None] * self._static
        at_first = records["response_amplitude"][:, 0, :]
        self._above_static = bool(np.any((at_first > static) & (static > 0.0)))

    def format(self) -> tuple[str, ...]:
        """Lines on loads; none while points are missing or have failed, as these may be those that move."""
        study = self._study
        if self._n_complete < math.prod(len(values) for values in study.dimensions.values()):
            return ()
        return (*self._on_frequencies(), *self._on_amplitudes())

    def _on_frequencies(self) -> tuple[str, ...]:
        if self._above_static:
            return ()
        frequency = self._study.axes.frequency
        low, high = min(frequency), max(frequency)
        given = f"{low:.6g} Hz" if low == high else f"{low:.6g} to {high:.6g} Hz"
        in_radians = f"{low / (2 * math.pi):.6g} to {high / (2 * math.pi):.6g} Hz"
        why = "the response is nowhere above that to the same load at rest, so that no resonance is near"
        return (f"frequency {given}: {why}: is it in rad/s (then it is {in_radians})?",)

    def _on_amplitudes(self) -> tuple[str, ...]:
        study = self._study
        at_rest = [
            value for value, wears in zip(study.axes.excitation_amplitude, self._wears, strict=True) if not wears
        ]
        counts = study.cycles_kept[-1] > 0.0 or "wear_rate" in study.outputs.variables
        if not at_rest or not self._could_wear or not counts:
            return ()
        named = ", ".join(f"{value:.6g}" for value in at_rest)
        slips = "no pair slips more than wear.threshold allows" if study.wear_law.threshold else "no pair slips"
        asked = "is the amplitude in N, the resonance among the frequencies?"
        return (
            f"excitation_amplitude {named} N: {slips} under pressure at any frequency, so that nothing wears: {asked}",
        )
