"""Keywords of the mesh: *NODE, *ELEMENT, *NSET, *ELSET, *SURFACE, and *PART with its *INSTANCE."""

from __future__ import annotations

import numpy as np

from studies.fe_models.deck.draft import Draft, DraftFace, DraftSurface
from studies.fe_models.deck.mesh import NODES_OF_KIND, FloatArray
from studies.fe_models.deck.sets import PART, read_reference
from studies.fe_models.text.keyword_lines import Block
from studies.fe_models.text.numbers import read_fields, read_floats, read_points, read_records
from studies.fe_models.text.read_errors import shown


def read_node(draft: Draft, block: Block) -> None:
    """*NODE: number, x, y, z."""
    if draft.in_parts and draft.scope != PART:
        draft.skip(block, " of the assembly")
        return
    if block.parameters.get("SYSTEM", "R").upper() != "R":
        raise block.place.wrong("nodes in cylindrical or spherical coordinates", "give them in Cartesian ones")
    numbers, coordinates = read_points(block)
    draft.nodes.append((numbers, coordinates, block.place))
    if "NSET" in block.parameters:
        draft.node_sets.add(draft.scope, block.name("NSET"), numbers)


def read_element(draft: Draft, block: Block) -> None:
    """*ELEMENT: number and nodes, over as many lines as the element needs."""
    kind = block.name("TYPE")
    if kind not in NODES_OF_KIND:
        known = ", ".join(NODES_OF_KIND)
        raise block.place.wrong(f"elements of type {shown(kind)}", f"mesh the model with {known}")
    length = NODES_OF_KIND[kind] + 1
    records = read_records(block, length, f"a {kind} of {length - 1} nodes with its number")
    draft.elements.append((kind, records, block.place))
    if "ELSET" in block.parameters:
        draft.element_sets.add(draft.scope, block.name("ELSET"), records[:, 0])


def read_nset(draft: Draft, block: Block) -> None:
    """*NSET: numbers, ranges, other sets, or the nodes of a set of elements."""
    name = block.name("NSET")
    draft.node_sets.add_block(draft.scope, name, block, draft.instance, draft.numbers_are_local(block))
    if "ELSET" in block.parameters:
        reference = read_reference(block.parameters["ELSET"], draft.scope, draft.instance, block.place)
        draft.node_sets.of_elements.setdefault((draft.scope, name), []).append(reference)


def read_elset(draft: Draft, block: Block) -> None:
    """*ELSET: numbers, ranges or other sets."""
    name = block.name("ELSET")
    draft.element_sets.add_block(draft.scope, name, block, draft.instance, draft.numbers_are_local(block))


def read_surface(draft: Draft, block: Block) -> None:
    """*SURFACE: faces of elements, or with TYPE=NODE nodes."""
    name = block.name("NAME")
    kind = block.parameters.get("TYPE", "ELEMENT").upper()
    if kind not in ("ELEMENT", "NODE") or "COMBINE" in block.parameters:
        draft.skip(block, f", TYPE={shown(kind)}")
        return
    surface = draft.surfaces.setdefault((draft.scope, name), DraftSurface(block.place))
    for line in range(len(block.lines)):
        place = block.place_of(line)
        fields = read_fields(block, line)
        reference = read_reference(fields[0] if fields else "", draft.scope, draft.instance, place)
        if kind == "NODE":
            surface.nodes.append(reference)
            continue
        label = fields[1].upper() if len(fields) > 1 else ""
        if label not in ("S1", "S2", "S3", "S4", "S5", "S6"):
            found = f"{shown(label)!r} in place of a face" if label else f"no face of {shown(fields[0])}"
            raise place.wrong(found, "give S1 to S6 behind each element or set")
        surface.faces.append(DraftFace(reference, int(label[1])))


def read_part(draft: Draft, block: Block) -> None:
    """*PART, of which there may be one."""
    if draft.in_parts:
        raise block.place.wrong("a second *PART", "write a flat deck: preprint, or one part with all elements")
    draft.in_parts = True
    draft.scope = PART


def read_instance(draft: Draft, block: Block) -> None:
    """*INSTANCE, of which there may be one; its mesh may be shifted and turned."""
    if draft.instance:
        raise block.place.wrong("a second *INSTANCE", "write a flat deck: preprint, or one part with all elements")
    draft.instance = block.name("NAME")
    draft.in_parts = True
    draft.scope = PART
    shift, turn = np.zeros(3), np.eye(3)
    if block.lines:
        shift = np.array(read_floats(block, 0, 3)[:3])
    if len(block.lines) > 1:
        values = read_floats(block, 1, 7)
        turn = _turn(np.array(values[3:6]) - values[:3], values[6], block)
        shift = turn @ shift + np.array(values[:3]) - turn @ np.array(values[:3])
    draft.shift = (shift, turn)


def read_end_of_scope(draft: Draft, _block: Block) -> None:
    """*END PART, *END INSTANCE: what follows belongs to the assembly."""
    draft.scope = ""


def read_nothing(_draft: Draft, _block: Block) -> None:
    """A keyword that says nothing about the model."""


def _turn(axis: FloatArray, degrees: float, block: Block) -> FloatArray:
    """Rotation (3, 3) by an angle about a direction (Rodrigues)."""
    length = np.linalg.norm(axis)
    if not 0 < length < np.inf:
        raise block.place.wrong("a rotation about two equal points", "give two points of the axis")
    x, y, z = axis / length
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = np.radians(degrees)
    turn: FloatArray = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return turn
