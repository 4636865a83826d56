"""Keywords of the mesh: nodes, elements, sets, surfaces, and what makes nodes and elements of others."""

from __future__ import annotations

import numpy as np

from studies.fe_models.deck.draft import Draft, Records, chosen, refused
from studies.fe_models.deck.mesh import NODES_OF_KIND, FloatArray
from studies.fe_models.text.keyword_lines import Block
from studies.fe_models.text.numbers import read_fields, read_floats, read_points, read_records
from studies.fe_models.text.read_errors import shown

OTHER_KINDS = {
    "MASS": 1,
    **dict.fromkeys(("T3D2", "T2D2", "B31", "B21", "SPRINGA", "DASHPOTA"), 2),
    **dict.fromkeys(("T3D3", "B32", "S3", "S3R", "CPS3", "CPE3", "M3D3", "STRI3"), 3),
    **dict.fromkeys(("S4", "S4R", "CPS4", "CPE4", "CPS4R", "CPE4R", "M3D4", "M3D4R", "SFM3D4", "R3D4"), 4),
    **dict.fromkeys(("S6", "CPS6", "CPE6", "M3D6", "STRI65"), 6),
    **dict.fromkeys(("S8", "S8R", "CPS8", "CPE8", "CPS8R", "CPE8R", "M3D8", "M3D8R"), 8),
}
"""Kinds of elements that are not read, and their numbers of nodes: without a section they carry nothing."""


def read_node(draft: Draft, block: Block) -> None:
    """*NODE: number, x, y, z, in the coordinates of *SYSTEM."""
    if chosen(block, "SYSTEM", ("R", "C", "S"), "R") != "R":
        raise refused(block, "nodes in cylindrical or spherical coordinates", "give them in Cartesian ones")
    numbers, coordinates = read_points(block)
    origin, axes = draft.system
    if draft.system is not draft.world:
        coordinates = coordinates @ axes + origin
    draft.nodes.append(Records(draft.scope, numbers, coordinates, block.place))
    if "NSET" in block.parameters:
        draft.node_sets.add(draft.scope, block.name("NSET"), numbers)


def read_system(draft: Draft, block: Block) -> None:
    """*SYSTEM: origin, a point on the first axis, a point in the plane of two axes; no data: the global one."""
    draft.system = draft.world
    if not block.lines:
        return
    values = read_floats(block, 0, 3)
    origin, first, second = np.array(values[:3]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    if len(values) >= 6:
        first = np.array(values[3:6]) - origin
        # without a third point the first axis turns about the global third one
        second = np.array(read_floats(block, 1, 3)[:3]) - origin if len(block.lines) > 1 else np.cross([0, 0, 1], first)
    draft.system = origin, frame_of(first, second, block)


def frame_of(first: FloatArray, second: FloatArray, block: Block) -> FloatArray:
    """Unit vectors (3, 3), one a row: along the first, in the plane of both, and across. Raises SceneError."""
    third = np.cross(first, second)
    frame = np.stack([first, np.cross(third, first), third])
    length = np.linalg.norm(frame, axis=1)
    if not ((length > 0) & (length < np.inf)).all():
        raise block.place_of(0).wrong(f"*{block.written} by points on one line", "give points that span a plane")
    return np.asarray(frame / length[:, None])


def read_element(draft: Draft, block: Block) -> None:
    """*ELEMENT: number and nodes, over as many lines as the element needs."""
    kind = block.name("TYPE")
    length = NODES_OF_KIND.get(kind) or OTHER_KINDS.get(kind)
    if length is None:
        known = ", ".join(NODES_OF_KIND)
        found = f"elements of type {shown(kind)}"
        raise block.place.wrong(found, f"mesh the model with {known}, and remove elements that carry nothing")
    records = read_records(block, length + 1, f"a {kind} of {length} nodes with its number")
    draft.elements.append(Records(draft.scope, records[:, 0], records[:, 1:], block.place, kind))
    if "ELSET" in block.parameters:
        draft.element_sets.add(draft.scope, block.name("ELSET"), records[:, 0])


def read_nset(draft: Draft, block: Block) -> None:
    """*NSET: numbers, ranges, other sets, or the nodes of a set of elements."""
    key = draft.scope, block.name("NSET")
    draft.node_sets.add_block(key, block, draft.placed)
    if "ELSET" in block.parameters:
        reference = draft.refer(block.parameters["ELSET"], block.place)
        draft.node_sets.of_elements.setdefault(key, []).append(reference)


def read_elset(draft: Draft, block: Block) -> None:
    """*ELSET: numbers, ranges or other sets."""
    draft.element_sets.add_block((draft.scope, block.name("ELSET")), block, draft.placed)


def read_surface(draft: Draft, block: Block) -> None:
    """*SURFACE: faces of elements, or with TYPE=NODE nodes."""
    name = block.name("NAME")
    kind = chosen(block, "TYPE", ("ELEMENT", "NODE"), "ELEMENT")
    surface = draft.surfaces.setdefault((draft.scope, name), [])
    for line in range(len(block.lines)):
        place, fields = block.place_of(line), read_fields(block, line)
        reference = draft.refer(fields[0] if fields else "", place)
        label = fields[1].upper() if len(fields) > 1 else ""
        if kind == "NODE":
            surface.append((reference, 0))
        elif label in ("S1", "S2", "S3", "S4", "S5", "S6"):
            surface.append((reference, int(label[1])))
        else:
            found = f"{shown(label)!r} in place of a face" if label else f"no face of {shown(fields[0])}"
            raise place.wrong(found, "give S1 to S6 behind each element or set")
        if (surface[0][1] == 0) != (kind == "NODE"):
            raise place.wrong("a surface of nodes and of faces", "give two surfaces")
