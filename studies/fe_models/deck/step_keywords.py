"""Keywords of steps, and *BOUNDARY, which may stand before the first of them."""

from __future__ import annotations

import numpy as np

from studies.fe_models.deck.draft import Draft, DraftBoundary, DraftLoad, DraftStep
from studies.fe_models.deck.model_keywords import read_pairs
from studies.fe_models.deck.sets import read_reference
from studies.fe_models.text.keyword_lines import Block
from studies.fe_models.text.numbers import read_fields, read_float, read_integer

PROCEDURES = (
    *("STATIC", "FREQUENCY", "DYNAMIC", "BUCKLE", "COMPLEXFREQUENCY", "GREEN", "HEATTRANSFER", "MATRIXGENERATE"),
    *("MODALDYNAMIC", "STEADYSTATEDYNAMICS", "SUBSTRUCTUREGENERATE", "VISCO"),
)
"""Keywords that say what a step computes."""

# displacements that the words of Abaqus hold, as first and last of them
_HELD: dict[str, tuple[tuple[int, int], ...]] = {
    "ENCASTRE": ((1, 6),),
    "PINNED": ((1, 3),),
    "XSYMM": ((1, 1), (5, 6)),
    "YSYMM": ((2, 2), (4, 4), (6, 6)),
    "ZSYMM": ((3, 5),),
    "XASYMM": ((2, 4),),
    "YASYMM": ((1, 1), (3, 3), (5, 5)),
    "ZASYMM": ((1, 2), (6, 6)),
}


def read_step(draft: Draft, block: Block) -> None:
    """*STEP."""
    if draft.step is not None:
        raise block.place.wrong("a *STEP within the one before", "write *END STEP above it")
    draft.step = DraftStep(block.place, block.parameters)
    draft.steps.append(draft.step)
    draft.interaction, draft.material = "", None


def read_end_step(draft: Draft, _block: Block) -> None:
    """*END STEP."""
    draft.step = None


def read_procedure(draft: Draft, block: Block) -> None:
    """*STATIC, *FREQUENCY and others: what the step computes."""
    if draft.step is None:
        draft.skip(block)
        return
    draft.step.kind = block.keyword.lower()
    draft.step.kind_parameters = dict(block.parameters)


def read_boundary(draft: Draft, block: Block) -> None:
    """*BOUNDARY: set or node, first and last dof, value; or one of Abaqus' words."""
    step = draft.step
    if step is not None and _is(block, "OP", "NEW"):
        step.replaced = True
        step.boundaries.clear()
    for parameter in ("SUBMODEL", "TYPE", "LOADCASE"):
        value = block.parameters.get(parameter, "DISPLACEMENT").upper()
        if value not in ("DISPLACEMENT", "1") or parameter == "SUBMODEL" in block.parameters:
            draft.skip(block, f", {parameter}")
            return
    boundaries = draft.boundaries if step is None else step.boundaries
    for line in range(len(block.lines)):
        place = block.place_of(line)
        fields = read_fields(block, line)
        if len(fields) < 2:
            raise place.wrong("a boundary condition without a dof", "give set, first and last dof")
        nodes = read_reference(fields[0], draft.scope, draft.instance, place)
        word = fields[1].upper()
        if word in _HELD:
            boundaries.extend(DraftBoundary(nodes, first, last, 0.0) for first, last in _HELD[word])
            continue
        if word == "0":  # a temperature or a mass flow
            draft.skip(block, " of dof 0")
            continue
        first = read_integer(word, place, "the first dof")
        last = read_integer(fields[2], place, "the last dof") if len(fields) > 2 and fields[2] else first
        value_ = read_float(fields[3], place) if len(fields) > 3 else 0.0
        boundaries.append(DraftBoundary(nodes, first, last, value_))


def read_dload(draft: Draft, block: Block) -> None:
    """*DLOAD: the lines with CENTRIF. Others are noted as not read."""
    if draft.step is None:
        draft.skip(block, " outside of a step")
        return
    if _is(block, "OP", "NEW"):
        draft.step.centrifugal.clear()
    for line in range(len(block.lines)):
        place = block.place_of(line)
        fields = read_fields(block, line)
        if len(fields) < 2 or fields[1].upper() != "CENTRIF":
            draft.skip(block, f" of type {fields[1].upper()[:20] if len(fields) > 1 else '?'}")
            continue
        values = [read_float(part, place) for part in fields[2:]]
        if len(values) < 6:
            raise place.wrong(f"{len(values)} numbers behind CENTRIF", "give omega^2, a point and the axis")
        values += [0.0] * (7 - len(values))
        axis = np.array(values[4:7])
        length = float(np.linalg.norm(axis))
        if not 0 < length < np.inf or values[0] < 0:
            raise place.wrong("CENTRIF without a direction, or with omega^2 < 0", "give omega^2 and the axis")
        elements = read_reference(fields[0], draft.scope, draft.instance, place)
        draft.step.centrifugal.append(DraftLoad(elements, values[0], np.array(values[1:4]), axis / length))


def read_equation(draft: Draft, block: Block) -> None:
    """*EQUATION: only with REMOVE ALL it is read."""
    if draft.step is not None and "REMOVEALL" in block.parameters:
        draft.step.equations_removed = True
    elif "REMOVE" in block.parameters or "REMOVEALL" in block.parameters:
        draft.skip(block, ", REMOVE")
    else:
        draft.skip(block)


def read_model_change(draft: Draft, block: Block) -> None:
    """*MODEL CHANGE, TYPE=CONTACT PAIR, REMOVE: the pairs that it takes away."""
    contact = "".join(block.parameters.get("TYPE", "").split()).upper() == "CONTACTPAIR"
    if draft.step is None or not contact or "REMOVE" not in block.parameters:
        draft.skip(block)
        return
    pairs = read_pairs(draft, block, "")
    draft.step.contact_removed.extend((str(pair.dependent.target), str(pair.independent.target)) for pair in pairs)


def _is(block: Block, parameter: str, value: str) -> bool:
    return block.parameters.get(parameter, "").strip().upper() == value
