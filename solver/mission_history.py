"""The wear of one joint over missions: blocks of vibration in order, repeated thousands of times, in Python."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import get_args

import numpy as np
from numpy.typing import ArrayLike

from solver.contact.wear_law import ARCHARD, WearLaw, wearing_work
from solver.forced_response import check_case, check_number, check_numbers, check_word
from solver.missions.history import integrate_missions
from solver.missions.mission import Begin, Block, Mission, MissionHistory, Passage
from solver.settings import TARGETS, Direction, SolverSettings, WearTarget
from solver.structure.joint import friction_of_pairs


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
) -> MissionHistory:
    """Mission history of a joint from its unworn state on: blocks of vibration in order, repeated many times.

    Depths are carried from block to block. Thousands of missions are integrated in steps of many missions at once
    (`solver.missions.step`). A failure is no exception: `outcome` and `message` of the history give the reason.

    Parameters
    ----------
    blocks
        Blocks in the order; of `solver.Block`.
    wear_coefficient
        k_w of Eq. (2), 1/Pa; with the law "energy" the energy wear coefficient.
    missions
        Ascending whole numbers of missions at which the history is reported, or the last number alone. A missing
        0 is added.
    settings
        The defaults of `SolverSettings` if not given.
    law
        The wear law; Archard's law if not given.
    until
        Wear depth or worn volume at which the history ends before; `missions_to_target` of the history is its number.
    sweep
        Way to the state of the first mission, where its first block continues the last one of the mission before.
    largest_step
        Most missions that are computed at once; 1: every mission by itself. By default the error decides.

    Raises
    ------
    ValueError
        A number is out of its range; numbers of missions are not whole or do not ascend; there is no block; the blocks
        do not have equal contact pairs; a block continues another one with another model or friction; a model, friction
        or law does not fit, see `solver.march_wear`.
    """
    settings = SolverSettings() if settings is None else settings
    check_word("sweep", sweep, get_args(Direction))
    if not blocks:
        raise ValueError("blocks: give at least one block")
    checked = tuple(_checked(block, place, settings, law) for place, block in enumerate(blocks))
    for place, block in enumerate(checked):
        _check_neighbours(checked[place - 1], block, place)
    counts = check_numbers("missions", missions, least=0.0)
    if (np.diff(counts) <= 0.0).any() or (counts != np.round(counts)).any() or counts[-1] < 1.0:
        raise ValueError("missions: give ascending whole numbers, the last of at least 1")
    if until is not None:
        check_word("until.quantity", until.quantity, TARGETS[:2])
        check_number("until.value", until.value, above=0.0)
    if largest_step is not None and largest_step != round(check_number("largest_step", largest_step, least=1.0)):
        raise ValueError(f"largest_step: give a whole number instead of {largest_step:g}")
    wanted = tuple(sorted({0, *(int(count) for count in counts)}))
    per_pressure = check_number("wear_coefficient", wear_coefficient, least=0.0)
    return integrate_missions(
        Mission(checked, per_pressure, wanted, settings, law, until, sweep, largest_step and int(largest_step))
    )


def _checked(block: Block, place: int, settings: SolverSettings, law: WearLaw) -> Block:
    """The block with its numbers checked; errors name it by its number and its name."""
    try:
        check_word("begin", block.way, get_args(Begin))
        load, friction = check_case(block.model, block.excitation_amplitude, block.friction_coefficient, "up", settings)
        wearing_work(law, block.model.contact, friction_of_pairs(block.model, friction))
        if block.way == "continue":
            # the way from another amplitude is a ramp of this one
            check_number("excitation_amplitude", load, above=0.0)
        found = replace(block, excitation_amplitude=load, friction_coefficient=friction)
        if isinstance(block.frequency, Passage):
            return replace(found, frequency=_checked_passage(block, block.frequency))
        if block.cycles is None:
            raise ValueError("cycles: missing: only a passage has cycles of its own")
        frequency = check_number("frequency", block.frequency, above=0.0)
        return replace(found, frequency=frequency, cycles=check_number("cycles", block.cycles, above=0.0))
    except ValueError as error:
        raise ValueError(f"{_called(place, block)}: {error}") from error


def _checked_passage(block: Block, passage: Passage) -> Passage:
    """The passage of a block with its numbers checked."""
    names = ("start", "stop", "rate")
    found = Passage(*(check_number(f"frequency.{name}", getattr(passage, name), above=0.0) for name in names))
    if found.start == found.stop:
        raise ValueError("frequency.stop: give another frequency than start")
    if block.cycles is not None:
        raise ValueError("cycles: the cycles of a passage follow from its rate: leave them out")
    if block.way != found.sweep:
        raise ValueError(f'begin: this passage goes {found.sweep}: give "{found.sweep}"')
    return found


def _check_neighbours(before: Block, block: Block, place: int) -> None:
    """Raises ValueError where a block does not have the pairs of the block before, or cannot continue it."""
    one, other = before.model.contact, block.model.contact
    same = one.n_contact == other.n_contact and (one.area == other.area).all() and one.surface == other.surface
    said = ""
    if not same or ((one.dofs < 0) != (other.dofs < 0)).any():
        said = "model: give equal contact pairs to all blocks"
    elif before.model.response_names != block.model.response_names:
        said = "model: give equal responses to all blocks"
    elif block.way == "continue":
        rubs = [friction_of_pairs(each.model, each.friction_coefficient) for each in (before, block)]
        if before.excitation_amplitude == 0.0:
            said = "begin: the block before does not vibrate: begin with a ramp"
        elif before.model is not block.model or (rubs[0] != rubs[1]).any():
            said = 'begin: continue goes with the model and friction of the block before: give "ramp", "up" or "down"'
    if said:
        raise ValueError(f"{_called(place, block)}: {said}")


def _called(place: int, block: Block) -> str:
    return f"blocks[{place}]" + (f" ({block.name})" if block.name else "")
