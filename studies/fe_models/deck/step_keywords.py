"""Keywords of steps and loads, *BOUNDARY, which may stand before the first step, and those that say nothing."""

from __future__ import annotations

import numpy as np

from studies.fe_models.deck.blocks import Block, Row
from studies.fe_models.deck.contents import Boundary, CentrifugalLoad, NodalForce, Pressure
from studies.fe_models.deck.keywords import keyword
from studies.fe_models.deck.model import Model, Step
from studies.fe_models.text import shown, unit

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
    **dict.fromkeys(("0", "11"), ()),  # a temperature, a mass flow
}


@keyword("ASSEMBLY", "", "NAME")
@keyword("ENDASSEMBLY HEADING")
def _nothing(_model: Model, _block: Block) -> None:
    """A keyword that says nothing about the model."""


@keyword("STEP", "", "PERTURBATION NLGEOM NAME INC UNSYMM AMPLITUDE CONVERTSDI EXTRAPOLATION SOLVER DIRECT")
def _step(model: Model, block: Block) -> None:
    if model.step is not None:
        raise block.place.wrong("a step within the one before", "write *END STEP above it")
    model.step = Step({name: dict(entries) for name, entries in model.fields.items()})
    model.interaction, model.material = None, None


@keyword("ENDSTEP")
def _end_step(model: Model, _block: Block) -> None:
    model.end_step()


@keyword(PROCEDURES, "*")
def _procedure(model: Model, block: Block) -> None:
    """What the step computes."""
    step = _step_of(model, block)
    step.kind = block.keyword
    if block.value("SOLVER") == "MATRIXSTORAGE" or block.keyword in ("MATRIXGENERATE", "SUBSTRUCTUREGENERATE"):
        step.writes = True
    if block.keyword.endswith("COUPLEDTEMPERATURE-DISPLACEMENT"):
        model.thermal["TEMPERATURE"] = block.place


@keyword("BOUNDARY", "OP TYPE LOADCASE FIXED", "AMPLITUDE")
def _boundary(model: Model, block: Block) -> None:
    """Set or node, first and last dof, value; or one of Abaqus' words."""
    if model.step is not None and block.value("OP") == "NEW":
        model.fields["boundaries"] = {}
    if block.value("TYPE") not in ("", "DISPLACEMENT") or block.value("LOADCASE") not in ("", "1"):
        raise block.place.wrong("TYPE or LOAD CASE is not read", "give displacements of one load case")
    for row in block.rows():
        held, value = _HELD.get(row.text(1).upper()), 0.0
        if held is None:
            first = row.whole(1, "the first dof")
            last = row.whole(2, "the last dof") if row.text(2) else first
            if last < first:
                raise row.place.wrong(f"dofs from {first} to {last}", "give the smaller one first")
            held, value = ((first, last),), 0.0 if "FIXED" in block.parameters else row.real(3)
        nodes = model.mesh.nodes(row.reference(0))
        model.add("boundaries", *(Boundary(str(row.place), nodes, *dofs, value) for dofs in held))


def _step_of(model: Model, block: Block) -> Step:
    if model.step is None:
        raise block.place.wrong("it is outside of a step", "write *STEP above it")
    return model.step


def _step_of_load(model: Model, block: Block, *names: str) -> Step:
    """The step of a load. With OP=NEW earlier ones of these fields are gone."""
    step = _step_of(model, block)
    if block.value("OP") == "NEW":
        model.fields.update((name, {}) for name in names)
    if "AMPLITUDE" in block.parameters and step.loads_count:
        raise block.place.wrong("a load with AMPLITUDE is not read", "give its last value without AMPLITUDE")
    return step


@keyword("CLOAD", "OP AMPLITUDE")
def _cload(model: Model, block: Block) -> None:
    """Node or set, dof, force; it counts in static steps."""
    step = _step_of_load(model, block, "forces")
    for row in block.rows(2, "node or set, dof and force"):
        nodes, dof, value = row.reference(0), row.whole(1, "a dof"), row.real(2)
        if dof > 3 and value and step.loads_count:
            raise row.place.wrong(f"a load along dof {dof}", "give forces: a moment is not read")
        force = NodalForce(str(row.place), model.mesh.nodes(nodes), dof, value)
        model.add("forces", force, key=(nodes.scope, nodes.target, dof))


@keyword("DLOAD", "OP AMPLITUDE")
def _dload(model: Model, block: Block) -> None:
    """CENTRIF in any step, P1 to P6 and GRAV in static ones; other loads are refused there."""
    static = model.step is not None and model.step.loads_count
    step = _step_of_load(model, block, "gravity", *(("centrifugal", "pressures") if static else ()))
    fresh = step.fresh
    for row in block.rows(2, "set, type and size"):
        kind = row.text(1).upper()
        if kind not in ("CENTRIF", "GRAV", "P1", "P2", "P3", "P4", "P5", "P6"):
            _refuse_load(row, step)
            continue
        reference = row.reference(0)
        elements = model.mesh.elements(reference)
        if kind == "GRAV":
            values = row.reals(2, 4, "size and direction")
            direction = unit(np.array(values[1:4]), row.place, "size and direction")
            model.add("gravity", (elements, values[0] * direction, row.place), key=reference.target)
        elif kind == "CENTRIF":
            values = row.reals(2, 6, "omega^2, a point and the axis")
            axis = np.array((values + [0.0])[4:7]) if values[0] >= 0 else np.zeros(3)
            axis = unit(axis, row.place, "omega^2 of at least 0, a point and the axis")
            if fresh:
                model.fields["centrifugal"] = {}  # the last step that has some
            fresh = step.fresh = False
            load = elements, values[0], np.array(values[1:4]), axis
            model.add("centrifugal", CentrifugalLoad(str(row.place), *load))
        else:
            pressure = Pressure(str(row.place), elements, np.full(elements.size, int(kind[1])), row.real(2))
            model.add("pressures", pressure, key=(reference.scope, reference.target, kind))


@keyword("DSLOAD", "OP AMPLITUDE")
def _dsload(model: Model, block: Block) -> None:
    """Surface, P, pressure; it counts in static steps."""
    step = _step_of_load(model, block, "pressures")
    for row in block.rows(2, "surface, P and pressure"):
        if row.text(1).upper() != "P":
            _refuse_load(row, step)
            continue
        surface = model.mesh.surfaces[model.mesh.surface(row.reference(0))]
        if surface.nodes.size:
            raise row.place.wrong("a pressure on a surface of nodes", "give a surface of element faces")
        load = Pressure(str(row.place), surface.elements, surface.faces, row.real(2))
        model.add("pressures", load, key=("surface", block.scope, row.text(0)))


def _refuse_load(row: Row, step: Step) -> None:
    """Raises SceneError where a load that is not read counts."""
    if step.loads_count:
        remedy = "give a pressure P, forces with *CLOAD, or `preload` in the study"
        raise row.place.wrong(f"a load of type {shown(row.text(1))} is not read", remedy)
