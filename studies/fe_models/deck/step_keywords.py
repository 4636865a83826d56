"""Keywords of steps and loads, *BOUNDARY, which may stand before the first step, and those that say nothing."""

from __future__ import annotations

import numpy as np

from studies.fe_models.deck.contents import Boundary, CentrifugalLoad, NodalForce, Pressure
from studies.fe_models.deck.draft import data_lines, keyword, refused, unit, value_of
from studies.fe_models.deck.model import Model, Step
from studies.fe_models.text import Block, Place, read_fields, read_float, read_integer, shown

PROCEDURES = (
    "STATIC FREQUENCY DYNAMIC BUCKLE COMPLEXFREQUENCY GREEN HEATTRANSFER MATRIXGENERATE MODALDYNAMIC"
    " STEADYSTATEDYNAMICS SUBSTRUCTUREGENERATE VISCO NOANALYSIS COUPLEDTEMPERATURE-DISPLACEMENT"
    " UNCOUPLEDTEMPERATURE-DISPLACEMENT"
)
"""Keywords that say what a step computes; their parameters and data do not matter."""

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


@keyword("ASSEMBLY", "", "NAME")
@keyword("ENDASSEMBLY HEADING")
def _nothing(_model: Model, _block: Block) -> None:
    """A keyword that says nothing about the model."""


@keyword("STEP", "", "PERTURBATION NLGEOM NAME INC UNSYMM AMPLITUDE CONVERTSDI EXTRAPOLATION SOLVER DIRECT")
def _step(model: Model, block: Block) -> None:
    if model.step is not None:
        raise block.place.wrong("a *STEP within the one before", "write *END STEP above it")
    model.step = Step({name: dict(entries) for name, entries in model.fields.items()})
    model.interaction, model.material = None, None


@keyword("ENDSTEP")
def _end_step(model: Model, _block: Block) -> None:
    model.end_step()


@keyword(PROCEDURES, "*")
def _procedure(model: Model, block: Block) -> None:
    """What the step computes."""
    if model.step is None:
        raise block.place.wrong(f"*{block.written} outside of a step", "write *STEP above it")
    model.step.kind = block.keyword
    if value_of(block, "SOLVER") == "MATRIXSTORAGE" or block.keyword in ("MATRIXGENERATE", "SUBSTRUCTUREGENERATE"):
        model.step.writes = True
    if block.keyword.endswith("COUPLEDTEMPERATURE-DISPLACEMENT"):
        model.thermal["TEMPERATURE"] = block.place


@keyword("BOUNDARY", "OP TYPE LOADCASE FIXED", "AMPLITUDE")
def _boundary(model: Model, block: Block) -> None:
    """Set or node, first and last dof, value; or one of Abaqus' words."""
    if model.step is not None and value_of(block, "OP") == "NEW":
        model.fields["boundaries"] = {}
    if value_of(block, "TYPE") not in ("", "DISPLACEMENT") or value_of(block, "LOADCASE") not in ("", "1"):
        raise refused(block, "TYPE or LOAD CASE is not read", "give displacements of one load case")
    for line in range(len(block.lines)):
        place, fields = block.place_of(line), read_fields(block, line)
        if len(fields) < 2:
            raise place.wrong("a boundary condition without a dof", "give set, first and last dof")
        word, value = fields[1].upper(), 0.0
        if word in ("0", "11"):  # a temperature or a mass flow
            continue
        held = _HELD.get(word)
        if held is None:
            first = read_integer(word, place, "the first dof")
            last = read_integer(fields[2], place, "the last dof") if len(fields) > 2 and fields[2] else first
            if last < first:
                raise place.wrong(f"dofs from {first} to {last}", "give the smaller one first")
            value = read_float(fields[3], place) if len(fields) > 3 and "FIXED" not in block.parameters else 0.0
            held = ((first, last),)
        name, nodes = model.mesh.nodes(model.refer(fields[0], place))
        model.add("boundaries", (Boundary(name, nodes, *dofs, value, str(place)) for dofs in held))


def _step_of_load(model: Model, block: Block, *names: str) -> Step:
    """The step of a load. With OP=NEW earlier ones of these fields are gone."""
    step = model.step
    if step is None:
        raise block.place.wrong(f"*{block.written} outside of a step", "write it below *STEP")
    if value_of(block, "OP") == "NEW":
        for name in names:
            model.fields[name] = {}
    if "AMPLITUDE" in block.parameters and step.loads_count:
        raise refused(block, "a load with AMPLITUDE is not read", "give its last value without AMPLITUDE")
    return step


@keyword("CLOAD", "OP AMPLITUDE")
def _cload(model: Model, block: Block) -> None:
    """Node or set, dof, force; it counts in static steps."""
    step = _step_of_load(model, block, "forces")
    for fields, place in data_lines(block, 2, "node or set, dof and force"):
        nodes, dof = model.refer(fields[0], place), read_integer(fields[1], place, "a dof")
        value = read_float(fields[2], place) if len(fields) > 2 else 0.0
        if dof > 3 and value and step.loads_count:
            raise place.wrong(f"*{block.written} along dof {dof}", "give forces: a moment is not read")
        force = NodalForce(f"{place}: *{block.written}", model.mesh.nodes(nodes)[1], dof, value)
        model.add("forces", [force], (nodes.scope, nodes.target, dof))


@keyword("DLOAD", "OP AMPLITUDE")
def _dload(model: Model, block: Block) -> None:
    """CENTRIF in any step, P1 to P6 and GRAV in static ones; other loads are refused there."""
    static = model.step is not None and model.step.loads_count
    step = _step_of_load(model, block, "gravity", *(("centrifugal", "pressures") if static else ()))
    fresh = True
    for fields, place in data_lines(block, 2, "set, type and size"):
        kind = fields[1].upper()
        pressure = kind in ("P1", "P2", "P3", "P4", "P5", "P6")
        if not pressure and kind not in ("CENTRIF", "GRAV"):
            if static:
                remedy = "give forces with *CLOAD, or `preload` in the study"
                raise place.wrong(f"*{block.written} of type {shown(kind)} is not read", remedy)
            continue
        reference = model.refer(fields[0], place)
        name, elements = model.mesh.elements(reference)
        values = [read_float(part, place) for part in fields[2:]]
        if pressure:
            faces = np.full(elements.size, int(kind[1]))
            load = Pressure(f"{place}: *{block.written}", elements, faces, values[0] if values else 0.0)
            model.add("pressures", [load], (reference.scope, reference.target, kind))
            continue
        least, what = (6, "omega^2, a point and the axis") if kind == "CENTRIF" else (4, "size and direction")
        if len(values) < least:
            raise place.wrong(f"{len(values)} numbers behind {kind}", f"give {what}")
        if kind == "GRAV":
            direction = unit(np.array(values[1:4]), place, "GRAV without a direction", f"give {what}")
            model.add("gravity", [(elements, values[0] * direction, place)], reference.target)
            continue
        axis = np.array((values + [0.0])[4:7]) if values[0] >= 0 else np.zeros(3)
        axis = unit(axis, place, "CENTRIF without a direction, or with omega^2 < 0", "give omega^2 and the axis")
        if fresh and step.fresh:
            model.fields["centrifugal"] = {}  # the last step that has some
        fresh = step.fresh = False
        model.add("centrifugal", [CentrifugalLoad(name, elements, values[0], np.array(values[1:4]), axis)])


@keyword("DSLOAD", "OP AMPLITUDE")
def _dsload(model: Model, block: Block) -> None:
    """Surface, P, pressure; it counts in static steps."""
    step = _step_of_load(model, block, "pressures")
    for fields, place in data_lines(block, 2, "surface, P and pressure"):
        if fields[1].upper() == "P":
            model.add("pressures", [_on_surface(model, block, fields, place)], ("surface", model.scope, fields[0]))
        elif step.loads_count:
            remedy = "give a pressure P, forces with *CLOAD, or `preload` in the study"
            raise place.wrong(f"*{block.written} of type {shown(fields[1])} is not read", remedy)


def _on_surface(model: Model, block: Block, fields: list[str], place: Place) -> Pressure:
    surface = model.mesh.surfaces[model.mesh.surface(model.refer(fields[0], place))]
    if surface.of_nodes:
        raise place.wrong("a pressure on a surface of nodes", "give a surface of element faces")
    value = read_float(fields[2] if len(fields) > 2 else "", place)
    return Pressure(f"{place}: *{block.written}", surface.elements, surface.faces, value)
