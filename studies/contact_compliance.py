"""The compliance of the contact as a parameter of scenes: `contact_stiffness`, a spring in series with each pair."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated

from pydantic import Field

from solver.compliant_contact import LARGEST_CONTACT_STIFFNESS, with_contact_stiffness
from solver.model import ReducedModel

ContactStiffness = Annotated[
    float | None,
    Field(
        gt=0,
        le=LARGEST_CONTACT_STIFFNESS,
        description="normal stiffness per area of rough surfaces; rigid if not given, N/m3",
    ),
]

_kept: dict[str, ReducedModel] = {}


def build_compliant(key: str, contact_stiffness: float | None, build: Callable[[], ReducedModel]) -> ReducedModel:
    """A model with its contact stiffness, N/m3.

    build: gives the model without it. The last of these models is kept under the key, which names all that the model
    depends on: a study with many contact stiffnesses reduces its finite-element model once.
    """
    if contact_stiffness is None:
        return build()
    if key not in _kept:
        _kept.clear()
        _kept[key] = build()
    return make_compliant(_kept[key], contact_stiffness)


def make_compliant(model: ReducedModel, contact_stiffness: float | None) -> ReducedModel:
    """A model with a contact stiffness, N/m3; as it is without one."""
    return model if contact_stiffness is None else with_contact_stiffness(model, contact_stiffness)
