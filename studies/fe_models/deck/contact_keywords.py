"""Keywords of what touches or is glued: ties, contact pairs with their laws and gaps, cyclic symmetry."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from studies.fe_models.deck.blocks import Block, Row
from studies.fe_models.deck.contents import SurfacePair
from studies.fe_models.deck.keywords import keyword
from studies.fe_models.deck.model import Interaction, Model
from studies.fe_models.text import is_integer, read_float, read_name, shown

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
    axis = np.array(block.reals(0, 6)[:6]).reshape(2, 3)
    if not 0 < np.linalg.norm(axis[1] - axis[0]) < np.inf:
        raise block.place.wrong("two equal points on the axis", "give two points that are apart")
    name = read_name(block.parameters.get("TIE", ""))
    model.add("cyclic", (int(number), name, model.mesh.placed(block.scope, axis), block.place))


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
    model.interaction = model.interactions.setdefault(block.name("NAME"), Interaction())


def _interaction_of(model: Model, block: Block) -> Interaction:
    if model.interaction is None:
        raise block.place.wrong("no interaction", "write *SURFACE INTERACTION above it")
    return model.interaction


@keyword("SURFACEBEHAVIOR", "PRESSURE-OVERCLOSURE", "PENALTY AUGMENTEDLAGRANGE DIRECT STIFFNESS")
def _behavior(model: Model, block: Block) -> None:
    """Hard contact, of which LINEAR is the penalty; TIED glues. The study may say that surfaces are soft."""
    law = block.chosen("PRESSURE-OVERCLOSURE", ("HARD", "LINEAR", "TIED"), "HARD")
    if law == "LINEAR":
        model.notes.append(f"{block.place}, LINEAR is read as hard contact (see contact_stiffness).")
    glued = f"{block.place}, PRESSURE-OVERCLOSURE=TIED" if law == "TIED" else ""
    _interaction_of(model, block).glued = glued


@keyword("FRICTION", _ONE_COEFFICIENT, "SLIPTOLERANCE ELASTICSLIP LAGRANGE SHEARTRACTIONSLOPE")
def _friction(model: Model, block: Block) -> None:
    """One coefficient; a law that is not read matters where the study gives no coefficient."""
    interaction = _interaction_of(model, block)
    laws = [name for name in _ONE_COEFFICIENT.split() if block.parameters.get(name, "0") != "0"]
    n_lines = 0 if "ROUGH" in laws else max(len(block.lines), 0 if laws else 1)
    values = [block.reals(line, 1)[0] for line in range(n_lines)]
    if min(values, default=0.0) < 0:
        raise block.place.wrong(f"a friction coefficient of {min(values):g}", "give one of at least 0")
    what = f" with {' and '.join(laws)}" if laws else " of several coefficients" if len(set(values)) > 1 else ""
    interaction.problem = f"{block.place}{what} is not read" if what else ""
    interaction.friction = None if what else values[0]


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
            elements = model.mesh.elements(row.reference(n))
            model.add("removed", (removed, elements, f"{row.place} takes elements away."))
