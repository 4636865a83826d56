"""Points that failed, or that are less exact than was asked for: where, how far, how well known, what to do."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from solver.outcome import COMPLETE, Outcome
from studyrunner.advice import advise
from studyrunner.plan.point_text import describe_point, describe_reach, settings_of
from studyrunner.plan.sharing import Index
from studyrunner.scene.scene import SceneFacts
from studyrunner.study.room_for_wear import describe_room
from studyrunner.study.sections import AUTO
from studyrunner.study.study import Study

MOST_NAMED = 10
"""Points that are named, of all outcomes together but for one each."""


@dataclass
class _Ended:
    """Points of one outcome and one advice: how many, and the first in the order of the file with what to say."""

    n: int = 0
    first: list[tuple[Index, str]] = field(default_factory=list)

    def add(self, points: Sequence[Index], said: str) -> None:
        """Some that have the same to say."""
        self.n += len(points)
        named = [*self.first, *((point, said) for point in sorted(points)[:MOST_NAMED])]
        self.first = sorted(named)[:MOST_NAMED]


class Findings:
    """Collects them from records of histories, some at a time; their order does not matter."""

    def __init__(self, study: Study, facts: SceneFacts) -> None:
        self._study = study
        self._largest_harmonics = facts.largest_harmonics if AUTO in study.harmonics else None
        self._ended: dict[tuple[int, str], _Ended] = {}

    def add(self, points: Sequence[tuple[Index, ...]], records: NDArray[np.void]) -> None:
        """Records (n,) as in `records`, and the points that each of them is of."""
        for row in np.flatnonzero(records["outcome"] != Outcome.CONVERGED).tolist():
            outcome, said = Outcome(records["outcome"][row]), self._say(records[row])
            # points that share a history were computed in one way
            advice = advise(outcome.meaning, settings_of(self._study, min(points[row])))
            self._ended.setdefault((outcome, advice), _Ended()).add(points[row], said)

    def format(self, outcomes: Mapping[int, int]) -> tuple[str, ...]:
        """For each way to end but `converged`, and each advice on it, a line with its number of points, then a line for
        each of the first.

        outcomes: points by number; those that are not computed are in no record.
        """
        lines: list[str] = []
        ends: dict[tuple[int, str], _Ended] = dict(self._ended)
        left = outcomes.get(Outcome.NOT_COMPUTED, 0)
        if left:
            ends[Outcome.NOT_COMPUTED, ""] = _Ended(left)
        most = max(1, MOST_NAMED // max(1, len(ends)))
        for number, advice in sorted(ends):
            ending, ended = Outcome(number), ends[number, advice]
            sentence = ending.sentence_of_mode if self._study.has_modes else ending.sentence
            text = " ".join(filter(None, (sentence, advice, self._remark(ending))))
            lines.append(f"{ended.n} x {ending.meaning}: {text}")
            if ending == Outcome.NOT_COMPUTED:
                continue
            for point, said in ended.first[:most]:
                text = ": ".join(filter(None, (describe_point(self._study, point), said)))
                lines += [f"  {text}"] if text else []
            if ended.n > most:
                lines.append(f"  and {ended.n - most} more")
        return tuple(lines)

    def _say(self, record: np.void) -> str:
        """What is known of a history: what its message says, and how far it came where that is not in it."""
        message = str(record["message"])
        if self._study.has_modes:
            return message
        of = "mission" if self._study.has_missions else "cycle"
        last = float(record[f"last_{of}"])
        if int(record["outcome"]) in COMPLETE or of in message:
            return message
        if math.isnan(last):
            return message or "no state was found"
        end = math.inf if self._study.to_the_end else self._study.cycles_kept[-1]
        return "; ".join(filter(None, (describe_reach(last, end, float(record["error_estimate"]), of), message)))

    def _remark(self, number: int) -> str:
        """What the study makes of it: the width that has room, or that a travelling wave has no more harmonics."""
        if number == Outcome.CONTACT_CUT_OFF:
            room = describe_room(self._study)
            return f" Here {room}." if room else ""
        if number != Outcome.INACCURATE or self._largest_harmonics is None:
            return ""
        return (
            f"The scene holds the nodal diameters of {self._largest_harmonics} harmonics: one that holds more allows"
            " for more."
        )
