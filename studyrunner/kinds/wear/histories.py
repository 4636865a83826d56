"""Tasks of wear: start states along a sweep, and wear histories that begin from them."""

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Literal, cast

import numpy as np
from numpy.typing import NDArray

from solver.contact.wear_law import WearLaw
from solver.model import ReducedModel
from solver.outcome import Outcome
from solver.packing import Packed, pack, unpack
from solver.settings import FollowedFrequency, Resolution, ToTheEnd, WearTarget
from studyrunner.kinds.joint import TaskJoint
from studyrunner.kinds.task import Identity, Keep, Part, PointResult, StartResult, Task, Work, digest, up_or_down
from studyrunner.kinds.wear.effort import share_done
from studyrunner.kinds.wear.kind import OWN_STEPS
from studyrunner.kinds.wear.onset import slip_amplitude
from studyrunner.kinds.wear.point import build_result
from studyrunner.mpi.dispatch import CostKeys

if TYPE_CHECKING:
    from solver.wear.wearing_joint import WearRequest

_COST_AT_REST = 0.01  # estimated time of a history in which nothing wears, over that of a history with steps
_NEIGHBOURS = 4  # frequencies whose histories take about as long
_ROUND_OFF = 1e-10

_digest_once = lru_cache(maxsize=16)(digest)


@dataclass(frozen=True)
class Excitation:
    """How a joint is excited on its way to a start state, beside the frequency; here another axis would be added.

    amplitude: N. direction: "up", "down" or "ramp". follow: what the frequency follows; None where it is given.
    """

    amplitude: float
    direction: str
    follow: FollowedFrequency | None

    def at(self, frequency: float) -> str:
        """Where a point is, in words: at its frequency, Hz, or at what the frequency follows."""
        return f"{frequency:.6g} Hz" if self.follow is None else f"the {self.follow.of}"


@dataclass(frozen=True, slots=True)
class Integrated:
    """A history that is integrated, and histories that are read from it with scaled slow time.

    scheme, step (cycles), largest_depth: as for `steps_of` of the solver. wear_coefficients: 1/Pa, of the histories,
    one result each; the first is the largest, which is integrated. unworn: whether nothing wears, so that the state at
    cycle 0 is that of all cycles.
    """

    scheme: str
    step: float
    largest_depth: float | None
    wear_coefficients: tuple[float, ...]
    unworn: bool

    def counts(self, cycles: Sequence[float], number: int) -> tuple[float, ...]:
        """Cycle counts of the integrated history at which a history is read, one for each of `cycles`."""
        if number == 0 and not self.unworn:
            # also where both wear coefficients are 0
            return tuple(cycles)
        ratio = 0.0 if self.unworn else self.wear_coefficients[number] / self.wear_coefficients[0]
        return tuple(ratio * cycle for cycle in cycles)

    @property
    def identity(self) -> tuple[object, ...]:
        """What decides the integrated history: scheme and step only where they matter."""
        own_steps = self.unworn or self.scheme in OWN_STEPS or self.largest_depth is not None
        scheme, step = "" if self.unworn else self.scheme, None if own_steps else self.step
        return (self.wear_coefficients[0], step, scheme, self.unworn, self.largest_depth)


@dataclass(frozen=True, kw_only=True, slots=True)
class _FromRest(Task):
    """A task with start states: it gives them, or begins from one."""

    joint: TaskJoint
    excitation: Excitation

    def name_of_start(self, identity: Identity, frequency: float) -> str:
        """Hash of a start state, whatever the other frequencies: the steps of a sweep follow from the joint."""
        line = _digest_once("line", identity.joint(self.joint), self.excitation, self.settings)
        return digest("start", line, frequency)


@dataclass(frozen=True, kw_only=True, slots=True)
class Sweep(_FromRest):
    """Start states along the frequency, or that of a ramp at a single frequency; a result at each frequency.

    frequencies: Hz, ascending; of a followed resonance the middle of its range.
    """

    gives_starts = True

    frequencies: tuple[float, ...]

    @property
    def way(self) -> str:
        """How the states are reached: "sweep" or "ramp"."""
        return "ramp" if self.excitation.direction == "ramp" else "sweep"

    @property
    def order(self) -> tuple[int, ...]:
        """Indices of the frequencies in the order of the sweep."""
        return up_or_down(len(self.frequencies), self.excitation.direction)

    def hashes(self, identity: Identity) -> tuple[str, ...]:
        """Hashes of the start states."""
        return tuple(self.name_of_start(identity, frequency) for frequency in self.frequencies)

    def compute(self, models: Mapping[int, ReducedModel], keep: Keep) -> Iterator[StartResult]:
        """Start states as the sweep reaches them."""
        given: set[int] = set()
        for result in self._compute(models, keep):
            given.add(result.place)
            yield result
        if len(given) < self.n_results and self.resume is not None:
            # the earlier run had passed states that are damaged, or that it did not need
            yield from replace(self, skipped=self.skipped | given, resume=None)._compute(models, keep)

    def _compute(self, models: Mapping[int, ReducedModel], keep: Keep) -> Iterator[StartResult]:
        # numba is loaded where a task runs, so that --plan and --help do without it
        from solver.loading_history.start_states import FrequencySweep

        model, wanted, excitation = self.joint.model(models), sorted(self.places), self.excitation
        n_displacements = int(np.count_nonzero(np.asarray(model.contact.dofs) >= 0))
        direction = cast("Literal['up', 'down', 'ramp']", excitation.direction)
        sweeps = FrequencySweep(model, excitation.amplitude, direction, self.settings, keep)
        if self.resume is not None:
            sweeps.load(self.resume)
        # no state depends on those that are skipped
        frequencies = excitation.follow or np.array([self.frequencies[place] for place in wanted])
        for place, start in sweeps.states(frequencies):
            if start.outcome is Outcome.EXCEPTION and self.resume is not None:
                raise RuntimeError(start.message)
            n_unknowns, moves = 0, False
            if start.state is not None:
                n_unknowns = n_displacements * (2 * len(start.resolution.orders) + 1)
                motion_h = start.state.displacement_h
                moves = bool(np.linalg.norm(motion_h[:, :, 1:]) > _ROUND_OFF * np.linalg.norm(motion_h))
            yield StartResult(wanted[place], pack(start), moves, n_unknowns)

    def failed(self, place: int, outcome: int, message: str) -> StartResult:  # noqa: ARG002
        """A start without a state."""
        from solver.results.history import StartState

        nan = math.nan
        broken = StartState(Outcome.EXCEPTION, None, nan, Resolution((1,), 4), nan, nan, 0, 0.0, message=message)
        return StartResult(place, pack(broken), moves=False, n_unknowns=0)

    def describe(self, place: int) -> str:
        """Where the sweep goes."""
        how = self.way if self.way == "ramp" else f"sweep {self.excitation.direction}"
        return f"{how} to {self.excitation.at(self.frequencies[place])}"


@dataclass(frozen=True, kw_only=True, slots=True)
class History(_FromRest):
    """Wear histories from a start state that share an adaptive history, each with those that are read from it.

    sweep, position, frequency: number of the sweep, place and frequency, Hz, of the start state.
    integrated: histories with one wear coefficient.
    cycles: cycle counts of the output of every history. to_the_end: integration until nothing wears any more; then
        `cycles` numbers the outputs. until: wear at which the history ends before the last count.
    loops: pairs whose fretting loops are among the variables.
    start, moves: of the start state, see StartResult; None and True until it is there.
    """

    law: WearLaw
    sweep: int
    position: int
    frequency: float
    integrated: tuple[Integrated, ...]
    cycles: tuple[float, ...]
    loops: tuple[int, ...]
    moves: bool = True
    until: WearTarget | None = None
    to_the_end: ToTheEnd | None = None
    start: Packed | None = field(default=None, compare=False, repr=False)

    @property
    def results(self) -> tuple[tuple[Integrated, int], ...]:
        """For each place the integrated history, and the number among those that are read from it."""
        return tuple((each, number) for each in self.integrated for number in range(len(each.wear_coefficients)))

    @property
    def waits_for(self) -> tuple[int, int]:
        """The start state."""
        return self.sweep, self.position

    @property
    def work(self) -> Work:
        """What it takes; of its histories those that are integrated."""
        return Work(self.way, 1, len(self.integrated), self.n_unknowns, self.cost, self.cost)

    @property
    def wear_coefficient(self) -> float:
        """Of the integrated histories, 1/Pa."""
        return self.integrated[0].wear_coefficients[0]

    @property
    def cost_keys(self) -> CostKeys:
        """By motion, unknowns and start state, and by wear coefficient, steps and schemes."""
        kind = "history" if self.moves else "history at rest"
        near, here = (kind, self.sweep, "near", self.position // _NEIGHBOURS), (kind, self.sweep, self.position)
        wear = (kind, self.wear_coefficient, tuple((each.step, each.scheme) for each in self.integrated))
        return (("task", kind, (kind, self.n_unknowns), near, here), (wear, (wear, near)))

    def from_start(self, result: StartResult) -> "History":
        """The history from a start state. Its time grows with the unknowns: a history seldom factorises anew."""
        n_unknowns = result.n_unknowns or self.n_unknowns
        cost = self.cost * (n_unknowns / self.n_unknowns * (1.0 if result.moves else _COST_AT_REST))
        return replace(self, start=result.start, cost=cost, n_unknowns=n_unknowns, moves=result.moves)

    def hashes(self, identity: Identity) -> tuple[str, ...]:
        """Hashes of the histories: of their start state, and of all that is done with it."""
        start = self.name_of_start(identity, self.frequency)
        outputs = _digest_once(identity.record, self.cycles, self.loops, self.until, self.to_the_end)
        return tuple(
            digest("history", start, outputs, self.law, each.identity, number > 0, each.wear_coefficients[number])
            for each, number in self.results
        )

    def compute(self, models: Mapping[int, ReducedModel], keep: Keep) -> Iterator[PointResult]:
        """All histories, read from those that are integrated, as far as these went."""
        from solver.wear.history import integrate_together

        if self.start is None:
            raise TypeError(f"task without a start state: {self}")
        needed: dict[Integrated, list[int]] = {}
        for place in self.places:
            needed.setdefault(self.results[place][0], []).append(place)
        model, asked = self.joint.model(models), [self.asked(each, self.until) for each in needed]
        start = unpack(self.start)
        first, end = next(iter(needed)), self.cycles[-1]

        def note(words: str, n_complete: int, share: float) -> None:
            # the first history takes nearly all of the time; to the end of wear nobody knows how far it is
            done = share_done(first.scheme, first.step, end, n_complete, share)
            keep(Part(done, f"{words} of {end:g}") if done > 0.0 else words)

        area = model.contact.area
        histories = integrate_together(model, self.settings, start, asked, keep, self.resume, note)
        slips = slip_amplitude(start, model)
        for (each, places), history in zip(needed.items(), histories, strict=True):
            for place in places:
                yield replace(build_result(self, each, history, self.results[place][1], slips, area), place=place)

    def asked(self, integrated: Integrated, until: WearTarget | None) -> "WearRequest":
        """What the solver is asked for. until: wear at which the history ends."""
        from solver.wear.wearing_joint import WearRequest, steps_of

        counts: NDArray[np.float64] | ToTheEnd
        if self.to_the_end is not None and not integrated.unworn:
            counts = self.to_the_end
        else:
            # a history begins at cycle 0, whether that count is asked for or not
            read = (integrated.counts(self.cycles, number) for number in range(len(integrated.wear_coefficients)))
            counts = np.unique([0.0, *itertools.chain.from_iterable(read)])
        return WearRequest(
            integrated.wear_coefficients[0],
            steps_of(integrated.scheme, integrated.step, integrated.largest_depth),
            counts,
            law=self.law,
            until=until,
            loops=self.loops,
            follow=self.excitation.follow,
        )

    def describe(self, place: int) -> str:
        """Its frequency and scheme."""
        return f"{self.excitation.at(self.frequency)} {self.results[place][0].scheme}"
