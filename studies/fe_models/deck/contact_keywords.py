"""Keywords of what touches or is glued: ties, contact pairs with their laws and gaps, cyclic symmetry."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from studies.fe_models.deck.draft import Draft, DraftInteraction, Items, chosen, refused
from studies.fe_models.deck.mesh import ContactPair, Tie
from studies.fe_models.deck.sets import Reference
from studies.fe_models.text.keyword_lines import Block, read_name
from studies.fe_models.text.numbers import is_integer, read_float, read_floats
from studies.fe_models.text.read_errors import Place, shown

if TYPE_CHECKING:
    from studies.fe_models.deck.resolve import Resolved

_MOST_SECTORS = 100_000
_ONE_COEFFICIENT = ("ROUGH", "TAUMAX", "EXPONENTIALDECAY", "ANISOTROPIC", "USER", "DEPENDENCIES", "PROPERTIES")


def read_tie(draft: Draft, block: Block) -> None:
    """*TIE: dependent and independent surface; with CYCLIC SYMMETRY the cut faces of a sector."""
    tolerance = read_float(block.parameters.get("POSITIONTOLERANCE", ""), block.place)
    name, cyclic = read_name(block.parameters.get("NAME", "")), "CYCLICSYMMETRY" in block.parameters
    pairs = list(read_pairs(draft, block))

    def ties(found: Resolved) -> Iterator[Tie]:
        for dependent, independent, _ in pairs:
            names = found.surface(dependent), found.surface(independent)
            yield Tie(name, *names, tolerance if tolerance > 0 else None, cyclic)

    draft.add("ties", ties)


def read_pairs(draft: Draft, block: Block) -> Iterator[tuple[Reference, Reference, Place]]:
    """The two surfaces of each data line, dependent one first."""
    if not block.lines:
        raise block.place.wrong(f"*{block.written} without surfaces", "give two surfaces below it")
    for fields, place in draft.lines(block, 1, "two surfaces"):
        if len(fields) < 2:
            raise place.wrong(f"one surface below *{block.written}", "give the dependent and the independent surface")
        yield draft.refer(fields[0], place), draft.refer(fields[1], place), place


def read_contact_pair(draft: Draft, block: Block) -> None:
    """*CONTACT PAIR: dependent and independent surface; with TIED they are glued."""
    name = read_name(block.parameters.get("INTERACTION", ""))
    pairs = list(read_pairs(draft, block))
    glued = f"{block.place}: *{block.written}, TIED" if "TIED" in block.parameters else ""
    adjusted = f"{block.place}: *{block.written}, ADJUST moves nodes" if "ADJUST" in block.parameters else ""
    interactions = draft.interactions

    def found_pairs(found: Resolved) -> Iterator[ContactPair]:
        law = interactions.get(name, DraftInteraction())
        for dependent, independent, _ in pairs:
            names = found.surface(dependent), found.surface(independent)
            if name and name not in interactions:
                raise block.place.wrong(f"there is no interaction {shown(name)}", "define it with *SURFACE INTERACTION")
            yield ContactPair(*names, name, law.friction, law.problem, glued or law.glued, adjusted=adjusted)

    draft.add("contact_pairs", found_pairs)


def read_interaction(draft: Draft, block: Block) -> None:
    """*SURFACE INTERACTION: what follows is about it."""
    draft.interaction = draft.interactions.setdefault(block.name("NAME"), DraftInteraction())


def read_behavior(draft: Draft, block: Block) -> None:
    """*SURFACE BEHAVIOR: hard contact, of which LINEAR is the penalty; TIED glues."""
    law = "".join(block.parameters.get("PRESSURE-OVERCLOSURE", "HARD").split()).upper()
    if draft.interaction is None:
        raise block.place.wrong(f"*{block.written} without an interaction", "write *SURFACE INTERACTION above it")
    if law not in ("HARD", "LINEAR", "TIED"):
        remedy = "write HARD, and give contact_stiffness in the study where the surfaces are soft"
        raise refused(block, f"PRESSURE-OVERCLOSURE={shown(law)} is not read", remedy)
    if law == "LINEAR":
        draft.notes.append(f"{block.place}: *{block.written}, LINEAR is read as hard contact (see contact_stiffness).")
    draft.interaction.glued = f"{block.place}: *{block.written}, PRESSURE-OVERCLOSURE=TIED" if law == "TIED" else ""


def read_friction(draft: Draft, block: Block) -> None:
    """*FRICTION: one coefficient; a law that is not read matters where the study gives no coefficient."""
    if draft.interaction is None:
        raise block.place.wrong(f"*{block.written} without an interaction", "write *SURFACE INTERACTION above it")
    laws = [name for name in _ONE_COEFFICIENT if block.parameters.get(name, "0") != "0"]
    values = [] if "ROUGH" in laws else [read_floats(block, line, 1)[0] for line in range(len(block.lines))]
    if not laws and not values:
        raise block.place.wrong(f"*{block.written} without its data line", "give the coefficient below it")
    if values and min(values) < 0:
        raise block.place_of(0).wrong(f"a friction coefficient of {min(values):g}", "give one of at least 0")
    what = f" with {' and '.join(laws)}" if laws else " of several coefficients" if len(set(values)) > 1 else ""
    draft.interaction.problem = f"{block.place}: *{block.written}{what} is not read" if what else ""
    draft.interaction.friction = None if what else values[0]


def read_clearance(draft: Draft, block: Block) -> None:
    """*CLEARANCE: the distance of two surfaces; negative for an interference."""
    if "VALUE" not in block.parameters:
        raise refused(block, "a clearance without VALUE", "give VALUE=..., one for both surfaces")
    value = read_float(block.parameters["VALUE"], block.place)
    dependent, independent = (draft.named(block, name) for name in ("SLAVE", "MASTER"))
    text = f"{block.place}: *{block.written} of {value:g}"
    draft.add("fits", _fits(dependent, independent, text, value, block.place))


def read_interference(draft: Draft, block: Block) -> None:
    """*CONTACT INTERFERENCE: the overlap of the mesh presses, as what is allowed of it ends at 0."""
    chosen(block, "TYPE", ("CONTACTPAIR",), "CONTACTPAIR")
    if "AMPLITUDE" in block.parameters and "SHRINK" not in block.parameters:
        raise refused(block, "an interference that does not end at 0", "leave AMPLITUDE out")
    text = f"{block.place}: *{block.written}"
    for dependent, independent, place in read_pairs(draft, block):
        draft.add("fits", _fits(dependent, independent, text, None, place))


def _fits(dependent: Reference, independent: Reference, text: str, value: float | None, place: Place) -> Items:
    return lambda found: [(found.surface(dependent), found.surface(independent), text, value, place)]


def read_model_change(draft: Draft, block: Block) -> None:
    """*MODEL CHANGE: contact pairs or elements that are taken away, or added again."""
    kind = chosen(block, "TYPE", ("CONTACTPAIR", "ELEMENT"), "ELEMENT")
    if draft.step is None or ("REMOVE" in block.parameters) == ("ADD" in block.parameters):
        raise refused(block, "neither REMOVE nor ADD in a step", "write one of them, in a step")
    removed = "REMOVE" in block.parameters
    if kind == "ELEMENT":
        for fields, place in draft.lines(block, 1, "sets of elements"):
            for text in fields:
                draft.add("removed", _removed(removed, draft.refer(text, place)))
        return
    for dependent, independent, _ in read_pairs(draft, block):
        draft.add("apart", _apart(removed, dependent, independent))


def _removed(removed: bool, elements: Reference) -> Items:
    return lambda found: [(removed, found.elements(elements)[1], _taken(elements, "elements"))]


def _apart(removed: bool, dependent: Reference, independent: Reference) -> Items:
    return lambda found: [
        (removed, (found.surface(dependent), found.surface(independent)), _taken(dependent, "a contact pair"))
    ]


def _taken(reference: Reference, what: str) -> str:
    return f"{reference.place}: *MODEL CHANGE takes {what} away."


def read_cyclic_symmetry(draft: Draft, block: Block) -> None:
    """*CYCLIC SYMMETRY MODEL: number of sectors, and two points on the axis."""
    number = block.parameters.get("N", "").strip()
    if not is_integer(number) or not 1 <= int(number) <= _MOST_SECTORS:
        raise block.place.wrong(f"N={shown(number)}", f"give a number of sectors from 1 to {_MOST_SECTORS}")
    axis = np.array(read_floats(block, 0, 6)[:6]).reshape(2, 3)
    if not 0 < np.linalg.norm(axis[1] - axis[0]) < np.inf:
        raise block.place_of(0).wrong("two equal points on the axis", "give two points that are apart")
    scope, name = draft.scope, read_name(block.parameters.get("TIE", ""))
    draft.add("cyclic", lambda found: [(int(number), name, found.placed(scope, axis), block.place)])
