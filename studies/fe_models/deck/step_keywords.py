"""Keywords of steps, and *BOUNDARY, which may stand before the first of them."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from studies.fe_models.deck.draft import Draft, DraftStep, Items, refused
from studies.fe_models.deck.mesh import Boundary, CentrifugalLoad, FloatArray, NodalForce, Pressure
from studies.fe_models.deck.sets import Reference
from studies.fe_models.text.keyword_lines import Block
from studies.fe_models.text.numbers import read_fields, read_float, read_integer
from studies.fe_models.text.read_errors import Place, shown

if TYPE_CHECKING:
    from studies.fe_models.deck.resolve import Resolved

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
    draft.step = DraftStep({name: dict(entries) for name, entries in draft.fields.items()})
    draft.interaction, draft.material = None, None


def read_end_step(draft: Draft, _block: Block) -> None:
    """*END STEP."""
    draft.end_step()


def read_procedure(draft: Draft, block: Block) -> None:
    """*STATIC, *FREQUENCY and others: what the step computes."""
    if draft.step is None:
        raise block.place.wrong(f"*{block.written} outside of a step", "write *STEP above it")
    draft.step.kind = block.keyword
    if _value(block, "SOLVER") == "MATRIXSTORAGE" or block.keyword in ("MATRIXGENERATE", "SUBSTRUCTUREGENERATE"):
        draft.step.writes = True
    if block.keyword in ("COUPLEDTEMPERATURE-DISPLACEMENT", "UNCOUPLEDTEMPERATURE-DISPLACEMENT"):
        draft.thermal["TEMPERATURE"] = block.place


def read_boundary(draft: Draft, block: Block) -> None:
    """*BOUNDARY: set or node, first and last dof, value; or one of Abaqus' words."""
    if draft.step is not None and _value(block, "OP") == "NEW":
        draft.clear("boundaries")
    if _value(block, "TYPE") not in ("", "DISPLACEMENT") or _value(block, "LOADCASE") not in ("", "1"):
        raise refused(block, "TYPE or LOAD CASE is not read", "give displacements of one load case")
    for line in range(len(block.lines)):
        place, fields = block.place_of(line), read_fields(block, line)
        if len(fields) < 2:
            raise place.wrong("a boundary condition without a dof", "give set, first and last dof")
        nodes = draft.refer(fields[0], place)
        word = fields[1].upper()
        if word in _HELD:
            for first, last in _HELD[word]:
                draft.add("boundaries", _boundary(nodes, first, last, 0.0))
        elif word not in ("0", "11"):  # a temperature or a mass flow
            first = read_integer(word, place, "the first dof")
            last = read_integer(fields[2], place, "the last dof") if len(fields) > 2 and fields[2] else first
            if last < first:
                raise place.wrong(f"dofs from {first} to {last}", "give the smaller one first")
            value = read_float(fields[3], place) if len(fields) > 3 and "FIXED" not in block.parameters else 0.0
            draft.add("boundaries", _boundary(nodes, first, last, value))


def _boundary(nodes: Reference, first: int, last: int, value: float) -> Items:
    return lambda found: [Boundary(*found.nodes(nodes), first, last, value, str(nodes.place))]


def read_cload(draft: Draft, block: Block) -> None:
    """*CLOAD: node or set, dof, force; it counts in static steps."""
    step = _loaded(draft, block, "forces")
    for fields, place in draft.lines(block, 2, "node or set, dof and force"):
        nodes, dof = draft.refer(fields[0], place), read_integer(fields[1], place, "a dof")
        value = read_float(fields[2], place) if len(fields) > 2 else 0.0
        if dof > 3 and value and step.loads_count:
            raise place.wrong(f"*{block.written} along dof {dof}", "give forces: a moment is not read")
        draft.add("forces", _forces(nodes, dof, value, f"{place}: *{block.written}"), (nodes.scope, nodes.target, dof))


def _forces(nodes: Reference, dof: int, value: float, text: str) -> Items:
    return lambda found: [NodalForce(text, found.nodes(nodes)[1], dof, value)]


def read_dload(draft: Draft, block: Block) -> None:
    """*DLOAD: CENTRIF in any step, P1 to P6 and GRAV in static ones; other loads are refused there."""
    step = _loaded(draft, block, "gravity")
    if _value(block, "OP") == "NEW" and step.loads_count:
        draft.clear("centrifugal")
        draft.clear("pressures")
    fresh = True
    for fields, place in draft.lines(block, 2, "set, type and size"):
        kind = fields[1].upper()
        if kind in ("P1", "P2", "P3", "P4", "P5", "P6"):
            elements, value = draft.refer(fields[0], place), read_float(fields[2] if len(fields) > 2 else "", place)
            text = f"{place}: *{block.written}"
            draft.add(
                "pressures", _pressures(elements, int(kind[1]), value, text), (elements.scope, elements.target, kind)
            )
            continue
        if kind not in ("CENTRIF", "GRAV"):
            if step.loads_count:
                remedy = "give forces with *CLOAD, or `preload` in the study"
                raise place.wrong(f"*{block.written} of type {shown(kind)} is not read", remedy)
            continue
        values = [read_float(part, place) for part in fields[2:]]
        least, what = (6, "omega^2, a point and the axis") if kind == "CENTRIF" else (4, "size and direction")
        if len(values) < least:
            raise place.wrong(f"{len(values)} numbers behind {kind}", f"give {what}")
        elements = draft.refer(fields[0], place)
        if kind == "GRAV":
            load = values[0] * _unit(np.array(values[1:4]), "GRAV without a direction", what, place)
            draft.add("gravity", _gravity(elements, load), elements.target)
            continue
        values += [0.0] * (7 - len(values))
        found = "CENTRIF without a direction, or with omega^2 < 0"
        axis = _unit(np.array(values[4:7]) if values[0] >= 0 else np.zeros(3), found, "omega^2 and the axis", place)
        if fresh and step.fresh:
            draft.clear("centrifugal")  # the last step that has some
        fresh = step.fresh = False
        draft.add("centrifugal", _centrifugal(elements, values, axis))


def _pressures(elements: Reference, face: int, value: float, text: str) -> Items:
    def pressures(found: Resolved) -> list[Pressure]:
        members = found.elements(elements)[1]
        return [Pressure(text, members, np.full(members.size, face), value)]

    return pressures


def read_dsload(draft: Draft, block: Block) -> None:
    """*DSLOAD: surface, P, pressure; it counts in static steps."""
    step = _loaded(draft, block, "pressures")
    for fields, place in draft.lines(block, 2, "surface, P and pressure"):
        if fields[1].upper() == "P":
            surface, value = draft.refer(fields[0], place), read_float(fields[2] if len(fields) > 2 else "", place)
            key = "surface", surface.scope, surface.target
            draft.add("pressures", partial(_on_surface, surface, value, f"{place}: *{block.written}"), key)
        elif step.loads_count:
            remedy = "give a pressure P, forces with *CLOAD, or `preload` in the study"
            raise place.wrong(f"*{block.written} of type {shown(fields[1])} is not read", remedy)


def _on_surface(surface: Reference, value: float, text: str, found: Resolved) -> list[Pressure]:
    faces = found.faces(found.surface(surface))
    if faces.of_nodes:
        raise surface.place.wrong("a pressure on a surface of nodes", "give a surface of element faces")
    return [Pressure(text, faces.elements, faces.faces, value)]


def _gravity(elements: Reference, acceleration: FloatArray) -> Items:
    return lambda found: [(found.elements(elements)[1], acceleration, elements.place)]


def _unit(vector: FloatArray, found: str, what: str, place: Place) -> FloatArray:
    length = float(np.linalg.norm(vector))
    if not 0 < length < np.inf:
        raise place.wrong(found, f"give {what}")
    return np.asarray(vector / length)


def _centrifugal(elements: Reference, values: list[float], axis: FloatArray) -> Items:
    return lambda found: [CentrifugalLoad(*found.elements(elements), values[0], np.array(values[1:4]), axis)]


def _loaded(draft: Draft, block: Block, field: str) -> DraftStep:
    """The step of a load. With OP=NEW earlier ones of the field are gone."""
    if draft.step is None:
        raise block.place.wrong(f"*{block.written} outside of a step", "write it below *STEP")
    if _value(block, "OP") == "NEW" and field:
        draft.clear(field)
    if "AMPLITUDE" in block.parameters and draft.step.loads_count:
        raise refused(block, "a load with AMPLITUDE is not read", "give its last value without AMPLITUDE")
    return draft.step


def _value(block: Block, parameter: str) -> str:
    return "".join(block.parameters.get(parameter, "").split()).upper()


def read_nothing(_draft: Draft, _block: Block) -> None:
    """A keyword that says nothing about the model."""
