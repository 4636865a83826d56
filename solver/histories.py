"""The wear of one joint over cycles or over missions, from a model in Python."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from solver.arguments import (
    Progress,
    check_case,
    check_kind,
    check_number,
    check_numbers,
    check_word,
    lines_to,
    worn_model,
)
from solver.contact.wear_law import ARCHARD, WearLaw, wearing_work
from solver.loading_history.start_states import FrequencySweep
from solver.missions.history import integrate_missions
from solver.missions.mission import Begin, Block, MissionHistory, MissionRequest
from solver.model import ReducedModel
from solver.outcome import check
from solver.results.history import WearHistory
from solver.settings import (
    FOLLOWED,
    TARGETS,
    Direction,
    Followed,
    FollowedFrequency,
    Passage,
    Scheme,
    SolverSettings,
    ToTheEnd,
    WearTarget,
)
from solver.wear.history import integrate_together
from solver.wear.wearing_joint import WearRequest, steps_of


def march_wear(
    model: ReducedModel,
    frequency: float | Followed,
    excitation_amplitude: float,
    friction_coefficient: ArrayLike | None,
    wear_coefficient: float,
    cycles: ArrayLike,
    *,
    scheme: Scheme | Literal["final"] = "adaptive",
    step: float | None = None,
    sweep: Direction = "up",
    settings: SolverSettings | None = None,
    law: WearLaw = ARCHARD,
    until: WearTarget | None = None,
    outputs: int = 101,
    final_share: float = 1e-4,
    wear_depth: ArrayLike | None = None,
    between: tuple[float, float] | None = None,
    progress: Progress | None = None,
) -> WearHistory:
    """Wear history of a joint that vibrates at one frequency, from its unworn state or from given depths on.

    A failure is no exception: `outcome` and `message` of the history give the reason and the last cycle count.

    - frequency: of the excitation, Hz; or "resonance" or "peak", which it follows while the joint wears, see `between`.
    - wear_coefficient: k_w of Eq. (2), 1/Pa; with the law "energy" the energy wear coefficient.
    - cycles: ascending cycle counts at which the history is reported, or the last count alone. A missing 0 is added.
      With inf the history ends where wear has come to an end, see `outputs`.
    - scheme, step: "adaptive" chooses its steps by `settings.rtol`. "implicit" and "explicit" take steps of `step`
      cycles, Eqs. (23), (24). "final" is "adaptive" to the final state, in which nothing wears any more; with
      `cycles` = inf.
    - law: of wear (`solver.contact.wear_law`).
    - until: wear at which the history ends before the last of `cycles`; `cycles_to_target` of the history is its count.
    - outputs, final_share: for `cycles` = inf: number of reported states, at least 2, the first and the last one
      included, spaced evenly in worn volume and cycles; the history ends where the wear rate of each pair is below this
      share of its largest one so far, which counts as at least this share of the largest of all pairs.
    - wear_depth: (n_contact,), m, of a joint that is worn before. Depths and volumes of the history count from there.
    - between: range of a frequency that is followed, Hz: (lowest, highest). The history begins at the first resonance
      that the sweep meets in the range. "resonance" is phase resonance: `F^H x` of the first harmonics of excitation
      and motion has no real part. "peak" is the largest amplitude of the first response in its first harmonic, over
      the frequency at constant wear depth; for one degree of freedom with the damping ratio zeta it lies lower by a
      factor sqrt(1 - 2 zeta^2).

    All others as in `frequency_response`. Raises ValueError as there; where counts do not ascend; where the scheme
    needs a step that is not given; where the law does not fit, or is a "table", whose factors depend on the depth, and
    `wear_depth` is given.
    """
    model, load, settings = check_case(model, excitation_amplitude, friction_coefficient, sweep, settings)
    at, follow = _check_frequency(frequency, between, sweep, scheme)
    per_pressure = check_number("wear_coefficient", wear_coefficient, least=0.0)
    to_the_end = np.ndim(cycles) == 0 and cycles == math.inf
    counts = check_numbers("cycles", 0.0 if to_the_end else cycles, least=0.0)
    check("cycles", (np.diff(counts) > 0.0).all(), "give ascending counts")
    counts = counts if counts[0] == 0.0 else np.append(0.0, counts)
    check_word("scheme", scheme, (*get_args(Scheme), "final"))
    ends = scheme != "final" or (to_the_end and until is None)
    check("scheme", ends, '"final" goes with cycles = inf and without until')
    grows = not to_the_end or scheme != "explicit"
    check("scheme", grows, 'explicit steps cannot grow: give "adaptive" or "implicit" with cycles inf')
    known = step is not None or scheme in ("adaptive", "final")
    check("step", known, f'give the length of a step in cycles to the scheme "{scheme}"')
    length = math.inf if step is None else check_number("step", step, above=0.0)
    check(f"outputs = {outputs}", not to_the_end or outputs >= 2, "give at least 2, the unworn and the final state")
    check_number("final_share", final_share, above=0.0)
    _check_target(until, TARGETS)
    check_kind("law", law, WearLaw)
    counted = wear_depth is None or law.name != "table"
    check("wear_depth", counted, 'give another law: the factors of a "table" depend on depths that count from 0')
    model = worn_model(model, wear_depth)
    # a law that does not fit the pairs is an error of the caller: raise it before the computation
    wearing_work(law, model.contact, per_pressure)
    keep = lines_to(progress)
    _, start = next(FrequencySweep(model, load, sweep, settings, keep).states(follow or np.array([at])))
    read_at = ToTheEnd(outputs, final_share) if to_the_end else counts
    steps = steps_of(scheme, length)
    request = WearRequest(per_pressure, steps, read_at, law=law, until=until, follow=follow)
    return next(integrate_together(model, settings, start, (request,), report=keep))


def _check_frequency(
    frequency: float | Followed, between: tuple[float, float] | None, sweep: Direction, scheme: str
) -> tuple[float, FollowedFrequency | None]:
    """The given frequency, Hz, or NaN and what the frequency follows."""
    if not isinstance(frequency, str):
        check("between", between is None, 'leave it out, or give "resonance" or "peak" as the frequency')
        return check_number("frequency", frequency, above=0.0), None
    check_word("frequency", frequency, FOLLOWED)
    ends = np.zeros(0) if between is None else check_numbers("between", between, above=0.0)
    ascend = ends.size == 2 and ends[0] < ends[1]
    check("between", ascend, "give the lowest and the highest frequency in Hz, as (205, 215)")
    check("sweep", sweep != "ramp", 'give "up" or "down": a ramp holds the frequency that is sought')
    check("scheme", scheme != "final", 'the scheme "final" holds the frequency: give "adaptive" with cycles = inf')
    return math.nan, FollowedFrequency(frequency, float(ends[0]), float(ends[1]))


def _check_target(until: WearTarget | None, known: tuple[str, ...]) -> None:
    """Whether a target is one of the known quantities, and above 0."""
    if until is not None:
        check_kind("until", until, WearTarget)
        check_word("until.quantity", until.quantity, known)
        check_number("until.value", until.value, above=0.0)


def integrate_mission(
    blocks: Sequence[Block],
    wear_coefficient: float,
    missions: ArrayLike,
    *,
    settings: SolverSettings | None = None,
    law: WearLaw = ARCHARD,
    until: WearTarget | None = None,
    sweep: Direction = "up",
    largest_step: int | None = None,
    progress: Progress | None = None,
) -> MissionHistory:
    """Mission history of a joint from its unworn state on: blocks of vibration in order, repeated many times.

    Depths are carried from block to block. Thousands of missions are integrated in steps of many missions at once. A
    failure is no exception: `outcome` and `message` of the history give the reason.

    - blocks: in the order; of `solver.Block`.
    - missions: ascending whole numbers of missions at which the history is reported, or the last number alone. A
      missing 0 is added.
    - wear_coefficient, settings, law: as for `march_wear`.
    - until: wear depth or worn volume at which the history ends before the last of `missions`; `missions_to_target`
      of the history is its number.
    - sweep: way to the state of the first mission, where its first block continues the last one of the mission before.
    - progress: as for `march_wear`.
    - largest_step: most missions that are computed at once; 1: every mission by itself. By default the error decides.

    Raises ValueError where a number is out of its range; where numbers of missions are not whole or do not ascend;
    where there is no block; where a model, friction, law or block does not fit to the others.
    """
    settings = SolverSettings() if settings is None else settings
    check_word("sweep", sweep, get_args(Direction))
    check("blocks", not isinstance(blocks, Block) and bool(blocks), "give a list with at least one block")
    check_kind("law", law, WearLaw)
    checked = tuple(_checked(block, place, settings, law) for place, block in enumerate(blocks))
    for place, block in enumerate(checked):
        one_model = blocks[place - 1].model is blocks[place].model
        reason = _does_not_follow(checked[place - 1], block, one_model=one_model)
        check(_called(place, block), not reason, reason)
    counts = check_numbers("missions", missions, least=0.0)
    right = (np.diff(counts) > 0.0).all() and (counts == np.round(counts)).all() and counts[-1] >= 1.0
    check("missions", right, "give ascending whole numbers, the last of at least 1")
    _check_target(until, TARGETS[:2])
    if largest_step is not None:
        whole = check_number("largest_step", largest_step, least=1.0).is_integer()
        check("largest_step", whole, f"give a whole number instead of {largest_step:g}")
    wanted = tuple(sorted({0, *(int(count) for count in counts)}))
    per_pressure = check_number("wear_coefficient", wear_coefficient, least=0.0)
    longest = largest_step and int(largest_step)
    asked = MissionRequest(checked, per_pressure, wanted, settings, law, until, sweep, longest)
    return integrate_missions(asked, report=lines_to(progress))


def _checked(block: Block, place: int, settings: SolverSettings, law: WearLaw) -> Block:
    """The block with its numbers checked; errors name it by its number and its name."""
    check_kind(f"blocks[{place}]", block, Block)
    try:
        check_word("begin", block.way, get_args(Begin))
        given = block.model, block.excitation_amplitude, block.friction_coefficient
        model, load, _ = check_case(*given, "up", settings)
        wearing_work(law, model.contact, 1.0)
        if block.way == "continue":
            # the way from another amplitude is a ramp of this one
            check_number("excitation_amplitude", load, above=0.0)
        at, cycles = block.frequency, block.cycles
        if isinstance(at, Passage):
            at = Passage(*(check_number(f"frequency.{name}", value, above=0.0) for name, value in vars(at).items()))
            check("frequency.stop", at.start != at.stop, "give another frequency than start")
            check("cycles", cycles is None, "the cycles of a passage follow from its rate: leave them out")
            check("begin", block.way == at.sweep, f'this passage goes {at.sweep}: give "{at.sweep}"')
        elif cycles is None:
            raise ValueError("cycles: missing: only a passage has cycles of its own")
        else:
            at, cycles = check_number("frequency", at, above=0.0), check_number("cycles", cycles, above=0.0)
        block = replace(block, model=model, friction_coefficient=None)
        return replace(block, excitation_amplitude=load, frequency=at, cycles=cycles)
    except ValueError as error:
        raise ValueError(f"{_called(place, block)}: {error}") from error


def _does_not_follow(before: Block, block: Block, *, one_model: bool) -> str:
    """Why a block does not have the pairs of the block before, or cannot continue it; else "".

    one_model: whether both were given the same model.
    """
    one, other = before.model.contact, block.model.contact
    same = one.n_contact == other.n_contact and (one.area == other.area).all() and one.surface == other.surface
    if not same or ((one.dofs < 0) != (other.dofs < 0)).any():
        return "model: give equal contact pairs to all blocks"
    if before.model.response_names != block.model.response_names:
        return "model: give equal responses to all blocks"
    if block.way != "continue":
        return ""
    if before.excitation_amplitude == 0.0:
        return "begin: the block before does not vibrate: begin with a ramp"
    if one_model and (one.friction == other.friction).all():
        return ""
    return 'begin: continue goes with the model and friction of the block before: give "ramp", "up" or "down"'


def _called(place: int, block: Block) -> str:
    return f"blocks[{place}]" + (f" ({block.name})" if block.name else "")
