"""Keywords of what touches or is glued, of steps and loads, *BOUNDARY, and those that say nothing."""

from collections.abc import Iterator

import numpy as np

from studies.fe_models.deck.contents import CentrifugalLoad, NodalValue, Pressure, SurfacePair
from studies.fe_models.deck.keywords import Block, Row, keyword, read_name, unit
from studies.fe_models.deck.model import Model, Step
from studies.fe_models.files import is_integer, read_float, shown

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
_MOST_SECTORS = 100_000
_SKIPPED = "TYPE SMALLSLIDING EXTENSIONZONE HCRIT SMOOTH TRACKING CPSET MINIMUMDISTANCE WEIGHT"
_ONE_COEFFICIENT = "ROUGH TAUMAX EXPONENTIALDECAY ANISOTROPIC USER DEPENDENCIES PROPERTIES"  # laws that are not


def _surface_pairs(model: Model, block: Block) -> Iterator[tuple[tuple[str, str], Row]]:
    """The two surfaces of each data line, dependent one first."""
    for row in block.rows(2, "the dependent and the independent surface"):
        yield (model.mesh.surface(row.reference(0)), model.mesh.surface(row.reference(1))), row


@keyword("TIE", "NAME POSITIONTOLERANCE CYCLICSYMMETRY", "ADJUST TYPE NOROTATION NOTHICKNESS CONSTRAINTRATIO")
def _tie(model: Model, block: Block) -> None:
    """Dependent and independent surface; with CYCLIC SYMMETRY the cut faces of a sector."""
    tolerance = read_float(block.parameters.get("POSITIONTOLERANCE", ""), block.place)
    name, cyclic = read_name(block.parameters.get("NAME", "")), "CYCLICSYMMETRY" in block.parameters
    for names, _ in _surface_pairs(model, block):
        model.add("ties", (name, cyclic, SurfacePair(*names, tolerance if tolerance > 0 else None)))


@keyword("CYCLICSYMMETRYMODEL", "N TIE", "NGRAPH ELSET CHECK")
def _cyclic_symmetry(model: Model, block: Block) -> None:
    """Number of sectors, and two points on the axis."""
    number = block.parameters.get("N", "")
    if not is_integer(number) or not 1 <= int(number) <= _MOST_SECTORS:
        raise block.place.wrong(f"N={shown(number)}", f"give a number of sectors from 1 to {_MOST_SECTORS}")
    axis = block.points()
    unit(axis[1] - axis[0], block.place, "two points on the axis that are apart")
    name = read_name(block.parameters.get("TIE", ""))
    model.add("cyclic", (int(number), name, model.mesh.draft.at(block.scope, axis), block.place))


@keyword("CONTACTPAIR", "INTERACTION TIED ADJUST", _SKIPPED)
def _contact_pair(model: Model, block: Block) -> None:
    """Dependent and independent surface; with TIED they are glued."""
    name = read_name(block.parameters.get("INTERACTION", ""))
    glued = f"{block.place}, TIED" if "TIED" in block.parameters else ""
    adjusted = f"{block.place}, ADJUST moves nodes" if "ADJUST" in block.parameters else ""
    for names, _ in _surface_pairs(model, block):
        model.add("contact_pairs", (names, name, glued, adjusted, block.place))


@keyword("SURFACEINTERACTION", "NAME")
def _interaction(model: Model, block: Block) -> None:
    """What follows is about it."""
    model.interaction = model.interactions.setdefault(block.name("NAME"), {})


@keyword("SURFACEBEHAVIOR", "PRESSURE-OVERCLOSURE", "PENALTY AUGMENTEDLAGRANGE DIRECT STIFFNESS")
def _behavior(model: Model, block: Block) -> None:
    """Hard contact, of which LINEAR is the penalty; TIED glues. The study may say that surfaces are soft."""
    law = block.chosen("PRESSURE-OVERCLOSURE", ("HARD", "LINEAR", "TIED"), "HARD")
    if law == "LINEAR":
        model.notes.append(f"{block.place}, LINEAR is read as hard contact (see contact_stiffness).")
    glued = f"{block.place}, PRESSURE-OVERCLOSURE=TIED" if law == "TIED" else ""
    block.below(model.interaction, "SURFACE INTERACTION")["glued"] = glued


@keyword("FRICTION", _ONE_COEFFICIENT, "SLIPTOLERANCE ELASTICSLIP LAGRANGE SHEARTRACTIONSLOPE")
def _friction(model: Model, block: Block) -> None:
    """One coefficient; a law that is not read matters where the study gives no coefficient."""
    interaction = block.below(model.interaction, "SURFACE INTERACTION")
    laws = [name for name in _ONE_COEFFICIENT.split() if block.parameters.get(name, "0") != "0"]
    n_lines = 0 if "ROUGH" in laws else max(len(block.lines), 0 if laws else 1)
    values = [block.reals(line, 1)[0] for line in range(n_lines)]
    if min(values, default=0.0) < 0:
        raise block.place.wrong(f"a friction coefficient of {min(values):g}", "give one of at least 0")
    what = f" with {' and '.join(laws)}" if laws else " of several coefficients" if len(set(values)) > 1 else ""
    interaction["problem"] = f"{block.place}{what} is not read" if what else ""
    interaction["friction_coefficient"] = None if what else values[0]


@keyword("CLEARANCE", "MASTER SLAVE VALUE")
def _clearance(model: Model, block: Block) -> None:
    """The distance of two surfaces; negative for an interference."""
    if "VALUE" not in block.parameters:
        raise block.place.wrong("a clearance without VALUE", "give VALUE=..., one for both surfaces")
    value = read_float(block.parameters["VALUE"], block.place)
    names = tuple(model.mesh.surface(block.reference(name)) for name in ("SLAVE", "MASTER"))
    model.add("fits", (names, value, block.place))


@keyword("CONTACTINTERFERENCE", "SHRINK TYPE AMPLITUDE", "OP")
def _interference(model: Model, block: Block) -> None:
    """The overlap of the mesh presses, as what is allowed of it ends at 0."""
    block.chosen("TYPE", ("CONTACTPAIR",), "CONTACTPAIR")
    if "AMPLITUDE" in block.parameters and "SHRINK" not in block.parameters:
        raise block.place.wrong("an interference that does not end at 0", "leave AMPLITUDE out")
    for names, row in _surface_pairs(model, block):
        model.add("fits", (names, None, row.place))


@keyword("MODELCHANGE", "TYPE REMOVE ADD")
def _model_change(model: Model, block: Block) -> None:
    """Contact pairs or elements that are taken away, or added again."""
    kind = block.chosen("TYPE", ("CONTACTPAIR", "ELEMENT"), "ELEMENT")
    removed = "REMOVE" in block.parameters
    if model.step is None or removed == ("ADD" in block.parameters):
        raise block.place.wrong("neither REMOVE nor ADD in a step", "write one of them, in a step")
    if kind == "CONTACTPAIR":
        for names, row in _surface_pairs(model, block):
            model.add("apart", (removed, names, f"{row.place} takes a contact pair away."))
        return
    for row in block.rows(1, "sets of elements"):
        for n in range(len(row.fields)):
            model.add("removed", (removed, model.mesh.elements(row.reference(n)), f"{row.place} takes elements away."))


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
    step = block.below(model.step, "STEP")
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
        model.add("boundaries", *(NodalValue(str(row.place), nodes, *dofs, value) for dofs in held))


def _step_of_load(model: Model, block: Block, *names: str) -> Step:
    """The step of a load. With OP=NEW earlier ones of these fields are gone, centrifugal ones in static steps alone."""
    step = block.below(model.step, "STEP")
    if block.value("OP") == "NEW":
        model.fields.update((name, {}) for name in names if name != "centrifugal" or step.loads_count)
    if "AMPLITUDE" in block.parameters and step.loads_count:
        raise block.place.wrong("a load with AMPLITUDE is not read", "give its last value without AMPLITUDE")
    return step


def _refuse_load(row: Row, step: Step) -> None:
    """Raises SceneError where a load that is not read counts."""
    if step.loads_count:
        remedy = "give a pressure P, forces with *CLOAD, or `preload` in the study"
        raise row.place.wrong(f"a load of type {shown(row.text(1))} is not read", remedy)


@keyword("CLOAD", "OP AMPLITUDE")
def _cload(model: Model, block: Block) -> None:
    """Node or set, dof, force; it counts in static steps."""
    step = _step_of_load(model, block, "forces")
    for row in block.rows(2, "node or set, dof and force"):
        nodes, dof, value = row.reference(0), row.whole(1, "a dof"), row.real(2)
        if dof > 3 and value and step.loads_count:
            raise row.place.wrong(f"a load along dof {dof}", "give forces: a moment is not read")
        force = NodalValue(str(row.place), model.mesh.nodes(nodes), dof, dof, value)
        model.add("forces", force, key=(nodes.scope, nodes.target, dof))


@keyword("DLOAD", "OP AMPLITUDE")
def _dload(model: Model, block: Block) -> None:
    """CENTRIF in any step, P1 to P6 and GRAV in static ones; other loads are refused there."""
    step = _step_of_load(model, block, "gravity", "centrifugal", "pressures")
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
            if step.fresh:
                model.fields["centrifugal"] = {}  # the last step that has some
            step.fresh = False
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
