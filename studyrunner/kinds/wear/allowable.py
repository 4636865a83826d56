"""Task of wear: the excitation amplitude at which a history just meets its target after the last cycle."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from solver.model import ReducedModel
from solver.packing import pack, unpack
from solver.settings import Direction
from studyrunner.kinds.task import Identity, Keep, Part, PointResult, Task, digest
from studyrunner.kinds.wear.effort import share_done
from studyrunner.kinds.wear.histories import History
from studyrunner.kinds.wear.point import build_result

if TYPE_CHECKING:
    from solver.allowable import Tried
    from solver.results.history import WearHistory

HISTORIES_OF_SEARCH = 8
"""Histories of a search. Dovetail, slider: 5 to 14, of which several do not wear, or end early."""

COST_OF_A_HISTORY = 1.4
"""Estimated time of one of them, over that of any history: near the amplitude that is sought a joint hardly slips
(dovetail with 16 pairs at 212.5 Hz: 1.8; at the resonance 0.9)."""


@dataclass(frozen=True, kw_only=True, slots=True)
class AllowableAmplitude(Task):
    """The search of one point, with sweeps of its own: each amplitude has another start state.

    history: that of the point, whose excitation has any amplitude, and whose target is the one to meet.
    """

    history: History

    way = "search"

    @classmethod
    def of(cls, history: History) -> "AllowableAmplitude":
        """The search of a history with one result."""
        names = ("number", "scenes", "settings", "cost", "n_unknowns", "variables", "indices")
        shared: dict[str, Any] = {name: getattr(history, name) for name in names}
        return cls(**shared, history=history)

    def hashes(self, identity: Identity) -> tuple[str, ...]:
        """Hash of all that decides the history but its amplitude."""
        return tuple(digest("allowable", name) for name in self.history.hashes(identity))

    def compute(self, models: Mapping[int, ReducedModel], keep: Keep) -> Iterator[PointResult]:
        """The history at the amplitude that is found; what was tried is kept."""
        # numba is loaded where a task runs, so that --plan and --help do without it
        from solver.allowable import find_allowable, stopping_at
        from solver.loading_history.start_states import FrequencySweep
        from solver.wear.history import integrate_together

        history, (integrated,) = self.history, self.history.integrated
        model, excitation, until = history.joint.model(models), history.excitation, history.until
        assert until is not None
        direction = cast("Direction", excitation.direction)
        asked = history.asked(integrated, stopping_at(until))
        frequencies, end = excitation.follow or np.array([history.frequency]), history.cycles[-1]
        known = () if self.resume is None else unpack(self.resume)
        n_tried = len(known)

        def history_at(amplitude: float) -> "WearHistory":
            def say(said: object, n_complete: int = 0, share: float = 0.0) -> None:
                if isinstance(said, str):
                    done = n_tried + share_done(integrated.scheme, integrated.step, end, n_complete, share)
                    words = f"{n_tried} of about {HISTORIES_OF_SEARCH} histories; {amplitude:.3g} N: {said}"
                    keep(Part(done / max(HISTORIES_OF_SEARCH, n_tried + 1), words))

            sweeps = FrequencySweep(model, amplitude, direction, self.settings, say)
            _, start = next(sweeps.states(frequencies))
            return next(integrate_together(model, self.settings, start, [asked], report=say))

        def note(tried: "tuple[Tried, ...]") -> None:
            nonlocal n_tried
            n_tried = len(tried)
            keep(pack(tried))

        found = find_allowable(history_at, until, self.settings.rtol, known, note)
        result = build_result(history, integrated, found.history, area=model.contact.area)
        own: dict[str, Any] = {"allowable_amplitude": found.amplitude, "allowable_amplitude_error": found.error}
        own |= {"outcome": int(found.outcome), "message": found.message}
        yield PointResult({**result.values, **own})

    def describe(self, place: int) -> str:  # noqa: ARG002
        """Its frequency and scheme."""
        return f"allowable amplitude {self.number + 1} at {self.history.describe(0)}"
