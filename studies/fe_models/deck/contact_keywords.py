"""Keywords of what touches or is glued: ties, contact pairs with their laws and gaps, cyclic symmetry."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from studies.fe_models.deck.contents import Tie
from studies.fe_models.deck.draft import chosen, data_lines, keyword, refused
from studies.fe_models.deck.model import Interaction, Model
from studies.fe_models.text import Block, Place, is_integer, read_float, read_floats, read_name, shown

_MOST_SECTORS = 100_000
_SKIPPED = "TYPE SMALLSLIDING EXTENSIONZONE HCRIT SMOOTH TRACKING CPSET MINIMUMDISTANCE WEIGHT"
_ONE_COEFFICIENT = "ROUGH TAUMAX EXPONENTIALDECAY ANISOTROPIC USER DEPENDENCIES PROPERTIES"  # laws that are not


def _surface_pairs(model: Model, block: Block) -> Iterator[tuple[tuple[str, str], Place]]:
    """The two surfaces of each data line, dependent one first."""
    for fields, place in data_lines(block, 1, "two surfaces"):
        if len(fields) < 2:
            raise place.wrong(f"one surface below *{block.written}", "give the dependent and the independent surface")
        first, second = (model.mesh.surface(model.refer(text, place)) for text in fields[:2])
        yield (first, second), place


@keyword("TIE", "NAME POSITIONTOLERANCE CYCLICSYMMETRY", "ADJUST TYPE NOROTATION NOTHICKNESS CONSTRAINTRATIO")
def _tie(model: Model, block: Block) -> None:
    """Dependent and independent surface; with CYCLIC SYMMETRY the cut faces of a sector."""
    tolerance = read_float(block.parameters.get("POSITIONTOLERANCE", ""), block.place)
    name, cyclic = read_name(block.parameters.get("NAME", "")), "CYCLICSYMMETRY" in block.parameters
    pairs = _surface_pairs(model, block)
    model.add("ties", (Tie(name, *names, tolerance if tolerance > 0 else None, cyclic) for names, _ in pairs))


@keyword("CYCLICSYMMETRYMODEL", "N TIE", "NGRAPH ELSET CHECK")
def _cyclic_symmetry(model: Model, block: Block) -> None:
    """Number of sectors, and two points on the axis."""
    number = block.parameters.get("N", "").strip()
    if not is_integer(number) or not 1 <= int(number) <= _MOST_SECTORS:
        raise block.place.wrong(f"N={shown(number)}", f"give a number of sectors from 1 to {_MOST_SECTORS}")
    axis = np.array(read_floats(block, 0, 6)[:6]).reshape(2, 3)
    if not 0 < np.linalg.norm(axis[1] - axis[0]) < np.inf:
        raise block.place_of(0).wrong("two equal points on the axis", "give two points that are apart")
    name = read_name(block.parameters.get("TIE", ""))
    model.add("cyclic", [(int(number), name, model.mesh.placed(model.scope, axis), block.place)])


@keyword("CONTACTPAIR", "INTERACTION TIED ADJUST", _SKIPPED)
def _contact_pair(model: Model, block: Block) -> None:
    """Dependent and independent surface; with TIED they are glued."""
    name = read_name(block.parameters.get("INTERACTION", ""))
    glued = f"{block.place}: *{block.written}, TIED" if "TIED" in block.parameters else ""
    adjusted = f"{block.place}: *{block.written}, ADJUST moves nodes" if "ADJUST" in block.parameters else ""
    pairs = _surface_pairs(model, block)
    model.add("contact_pairs", ((names, name, glued, adjusted, block.place) for names, _ in pairs))


@keyword("SURFACEINTERACTION", "NAME")
def _interaction(model: Model, block: Block) -> None:
    """What follows is about it."""
    model.interaction = model.interactions.setdefault(block.name("NAME"), Interaction())


def _interaction_of(model: Model, block: Block) -> Interaction:
    if model.interaction is None:
        raise block.place.wrong(f"*{block.written} without an interaction", "write *SURFACE INTERACTION above it")
    return model.interaction


@keyword("SURFACEBEHAVIOR", "PRESSURE-OVERCLOSURE", "PENALTY AUGMENTEDLAGRANGE DIRECT STIFFNESS")
def _behavior(model: Model, block: Block) -> None:
    """Hard contact, of which LINEAR is the penalty; TIED glues."""
    law = "".join(block.parameters.get("PRESSURE-OVERCLOSURE", "HARD").split()).upper()
    interaction = _interaction_of(model, block)
    if law not in ("HARD", "LINEAR", "TIED"):
        remedy = "write HARD, and give contact_stiffness in the study where the surfaces are soft"
        raise refused(block, f"PRESSURE-OVERCLOSURE={shown(law)} is not read", remedy)
    if law == "LINEAR":
        model.notes.append(f"{block.place}: *{block.written}, LINEAR is read as hard contact (see contact_stiffness).")
    interaction.glued = f"{block.place}: *{block.written}, PRESSURE-OVERCLOSURE=TIED" if law == "TIED" else ""


@keyword("FRICTION", _ONE_COEFFICIENT, "SLIPTOLERANCE ELASTICSLIP LAGRANGE SHEARTRACTIONSLOPE")
def _friction(model: Model, block: Block) -> None:
    """One coefficient; a law that is not read matters where the study gives no coefficient."""
    interaction = _interaction_of(model, block)
    laws = [name for name in _ONE_COEFFICIENT.split() if block.parameters.get(name, "0") != "0"]
    values = [] if "ROUGH" in laws else [read_floats(block, line, 1)[0] for line in range(len(block.lines))]
    if not laws and not values:
        raise block.place.wrong(f"*{block.written} without its data line", "give the coefficient below it")
    if values and min(values) < 0:
        raise block.place_of(0).wrong(f"a friction coefficient of {min(values):g}", "give one of at least 0")
    what = f" with {' and '.join(laws)}" if laws else " of several coefficients" if len(set(values)) > 1 else ""
    interaction.problem = f"{block.place}: *{block.written}{what} is not read" if what else ""
    interaction.friction = None if what else values[0]


@keyword("CLEARANCE", "MASTER SLAVE VALUE")
def _clearance(model: Model, block: Block) -> None:
    """The distance of two surfaces; negative for an interference."""
    if "VALUE" not in block.parameters:
        raise refused(block, "a clearance without VALUE", "give VALUE=..., one for both surfaces")
    value = read_float(block.parameters["VALUE"], block.place)
    names = tuple(model.mesh.surface(model.named(block, name)) for name in ("SLAVE", "MASTER"))
    model.add("fits", [(names, f"{block.place}: *{block.written} of {value:g}", value, block.place)])


@keyword("CONTACTINTERFERENCE", "SHRINK TYPE AMPLITUDE", "OP")
def _interference(model: Model, block: Block) -> None:
    """The overlap of the mesh presses, as what is allowed of it ends at 0."""
    chosen(block, "TYPE", ("CONTACTPAIR",), "CONTACTPAIR")
    if "AMPLITUDE" in block.parameters and "SHRINK" not in block.parameters:
        raise refused(block, "an interference that does not end at 0", "leave AMPLITUDE out")
    text = f"{block.place}: *{block.written}"
    model.add("fits", ((names, text, None, place) for names, place in _surface_pairs(model, block)))


@keyword("MODELCHANGE", "TYPE REMOVE ADD")
def _model_change(model: Model, block: Block) -> None:
    """Contact pairs or elements that are taken away, or added again."""
    kind = chosen(block, "TYPE", ("CONTACTPAIR", "ELEMENT"), "ELEMENT")
    removed = "REMOVE" in block.parameters
    if model.step is None or removed == ("ADD" in block.parameters):
        raise refused(block, "neither REMOVE nor ADD in a step", "write one of them, in a step")
    if kind == "CONTACTPAIR":
        for names, place in _surface_pairs(model, block):
            model.add("apart", [(removed, names, f"{place}: *MODEL CHANGE takes a contact pair away.")])
        return
    for fields, place in data_lines(block, 1, "sets of elements"):
        for text in fields:
            elements = model.mesh.elements(model.refer(text, place))[1]
            model.add("removed", [(removed, elements, f"{place}: *MODEL CHANGE takes elements away.")])
