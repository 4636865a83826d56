"""A reduced model as text and plain arrays for a file (`solver.packing`)."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from solver.model import ContactInterface, LinearModel, ReducedModel
from solver.packing import Packed, pack, packable, unpack

for _part in (ContactInterface, LinearModel, ReducedModel):
    packable(_part)


def pack_model(model: ReducedModel) -> Packed | None:
    """The model; None where arrays are not stored by rows (C order), which they are after unpacking.

    The memory order of the matrices determines the last bits of all results. No bundled scene has other arrays.
    """
    parts = [*((linear, fields(linear)) for linear in model.linear.values()), (model.contact, fields(model.contact))]
    values = [getattr(part, entry.name) for part, entries in parts for entry in entries]
    if not all(value.flags.c_contiguous for value in values if isinstance(value, np.ndarray)):
        return None
    return pack((tuple(model.linear.items()), replace(model, linear={})))


def unpack_model(packed: Packed) -> ReducedModel:
    """The model that was packed, equal to the last bit; errors as `unpack`, where it does not describe a model."""
    linear, model = unpack(packed)
    if not isinstance(model, ReducedModel):
        raise TypeError(type(model).__name__)
    return replace(model, linear=dict(linear))
