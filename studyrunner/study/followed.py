"""An excitation whose frequency follows the resonance while the joint wears: `frequency = "resonance"` or "peak".

The axis `frequency` then has one value, the middle of the range: a point has no given frequency, and the variable
`excitation_frequency` holds the one at each count.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BeforeValidator, Field, TypeAdapter

from solver.settings import FOLLOWED, FollowedFrequency
from studyrunner.study.similar_names import nearest_name
from studyrunner.study.values import Number, Section, read
from studyrunner.user_error import UserError, WrongValueError

_NUMBER = TypeAdapter(Number)


def _read_range(value: object) -> tuple[float, float]:
    remedy = "give the lowest and the highest frequency in Hz, as [205, 215]"
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise WrongValueError(value, remedy)
    low, high = (read(_NUMBER, end) for end in value)
    if not 0.0 < low < high:
        raise WrongValueError(value, remedy)
    return low, high


class LoadingSection(Section):
    """[loading]: range of a frequency that is followed."""

    between: Annotated[tuple[float, float], BeforeValidator(_read_range)] = Field(
        description='Hz, [lowest, highest] frequency of the excitation with axes.frequency = "resonance" or "peak"'
    )


def take_followed(sections: dict[str, Any], source: str) -> FollowedFrequency | None:
    """What the frequency follows, None where it is given; the axis then gets the middle of the range.

    sections: tables of the study file. source: the file as the user named it. Raises UserError.
    """
    axes, loading = sections["axes"], sections.get("loading")
    given = axes.get("frequency")
    words = [each for each in (given if isinstance(given, list | tuple) else [given]) if isinstance(each, str)]
    if not words:
        if loading is not None:
            remedy = 'leave it out, or give axes.frequency = "resonance" or "peak", which is followed in this range'
            raise UserError(source, "loading", loading, remedy)
        return None
    if words[0] not in FOLLOWED:
        raise UserError(source, "axes.frequency", words[0], 'give a number in Hz, or "resonance" or "peak"')
    if given not in (words[0], words):
        remedy = f'give "{words[0]}" alone: every point has the frequency that it finds'
        raise UserError(source, "axes.frequency", given, remedy)
    if len(words) > 1:
        raise UserError(source, "axes.frequency", given, f'give "{words[0]}" alone, and another study for the other')
    if loading is None:
        remedy = "missing: give the range in which the frequency is sought, Hz, as between = [205, 215]"
        raise UserError(source, "loading.between", None, remedy)
    for key, value in loading.items():
        if key not in LoadingSection.model_fields:
            remedy = f"unknown key, give {nearest_name(key, LoadingSection.model_fields)}"
            raise UserError(source, f"loading.{key}", value, remedy)
    try:
        low, high = _read_range(loading.get("between"))
    except WrongValueError as error:
        raise UserError(source, "loading.between", error.value, error.remedy) from None
    sections["axes"] = {**axes, "frequency": 0.5 * low + 0.5 * high}
    return FollowedFrequency(words[0], low, high)
