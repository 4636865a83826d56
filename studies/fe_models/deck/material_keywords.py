"""Keywords of materials, of sections that give them to elements, and of temperatures."""

from __future__ import annotations

from typing import TYPE_CHECKING

from studies.fe_models.deck.draft import Draft, DraftMaterial, Items, refused
from studies.fe_models.deck.mesh import IntArray, SolidSection
from studies.fe_models.deck.sets import Reference
from studies.fe_models.text.keyword_lines import Block
from studies.fe_models.text.numbers import read_float, read_floats
from studies.fe_models.text.read_errors import shown

if TYPE_CHECKING:
    from studies.fe_models.deck.resolve import Resolved


def read_material(draft: Draft, block: Block) -> None:
    """*MATERIAL: what follows is about it."""
    draft.material = draft.materials.setdefault(block.name("NAME"), DraftMaterial())


def read_elastic(draft: Draft, block: Block) -> None:
    """*ELASTIC: Young's modulus, Poisson's ratio, temperature; a law that is not isotropic matters where it is used."""
    material = _material(draft, block)
    _refuse_again(material, "ELASTIC", block)
    material.places["ELASTIC"], material.problem = block.place, ""
    law = block.parameters.get("TYPE", "ISO").upper()
    if law not in ("ISO", "ISOTROPIC") or block.parameters.get("DEPENDENCIES", "0") != "0":
        what = f"TYPE={shown(law)}" if law not in ("ISO", "ISOTROPIC") else "DEPENDENCIES"
        material.problem = f"{block.place}: *{block.written}, {what} is not read"
        return
    material.elastic = [read_floats(block, line, 2) for line in range(max(len(block.lines), 1))]
    for line, (young, poisson, *_) in enumerate(material.elastic):
        if not young > 0 or not -1 < poisson < 0.5:
            found = f"Young's modulus {young:g} and Poisson's ratio {poisson:g}"
            raise block.place_of(line).wrong(found, "give a positive modulus, and a ratio between -1 and 0.5")


def read_density(draft: Draft, block: Block) -> None:
    """*DENSITY: density, temperature."""
    material = _material(draft, block)
    _refuse_again(material, "DENSITY", block)
    material.places["DENSITY"] = block.place
    material.density = [read_floats(block, line, 1) for line in range(max(len(block.lines), 1))]
    for line, (density, *_) in enumerate(material.density):
        if not density > 0:
            raise block.place_of(line).wrong(f"a density of {density:g}", "give a positive one")


def _refuse_again(material: DraftMaterial, keyword: str, block: Block) -> None:
    """A material is given once: programs differ in which of two they take. The same lines serve several instances."""
    if material.places.get(keyword, block.place) != block.place:
        found = f"*{block.written} of one material again (before: {material.places[keyword]})"
        raise block.place.wrong(found, "give each material once")


def _material(draft: Draft, block: Block) -> DraftMaterial:
    if draft.material is None:
        raise block.place.wrong(f"*{block.written} without a material", "write *MATERIAL, NAME=... above it")
    return draft.material


def read_section(draft: Draft, block: Block) -> None:
    """*SOLID SECTION: a set of elements and its material."""
    reference, material = draft.named(block, "ELSET"), block.name("MATERIAL")

    def sections(found: Resolved) -> list[SolidSection]:
        name = found.elements(reference)[0]
        if material not in draft.materials:
            raise block.place.wrong(f"there is no material {shown(material)}", "define it with *MATERIAL")
        return [SolidSection(name, material)]

    draft.add("sections", sections)
    read_other_section(draft, block)


def read_other_section(draft: Draft, block: Block) -> None:
    """*BEAM SECTION, *MASS and others: elements that are not read carry something."""
    reference = draft.named(block, "ELSET")

    def unassembled(found: Resolved) -> list[tuple[str, IntArray]]:
        elements = found.elements(reference)[1]
        kinds = found.other_kinds(elements)
        text = f"{block.place}: *{block.written} of elements of type {' and '.join(kinds)}, which are not read"
        return [(text, elements)] if kinds else []

    draft.add("unassembled", unassembled)


def read_initial_conditions(draft: Draft, block: Block) -> None:
    """*INITIAL CONDITIONS: temperatures; velocities do not matter."""
    kind = block.parameters.get("TYPE", "").upper()
    if kind == "VELOCITY":
        draft.skip(block)
        return
    if kind != "TEMPERATURE":
        raise refused(block, f"TYPE={shown(kind)} is not read", "remove it: the prestress is that of the rotation")
    for fields, place in draft.lines(block, 2, "set of nodes and temperature"):
        draft.add("temperatures", _temperatures(draft.refer(fields[0], place), read_float(fields[1], place)))


def _temperatures(nodes: Reference, value: float) -> Items:
    return lambda found: [(found.nodes(nodes)[1], value)]


def read_thermal(draft: Draft, block: Block) -> None:
    """*EXPANSION and *TEMPERATURE: they change nothing but where there are both, or values at several temperatures."""
    draft.thermal[block.keyword] = block.place
    draft.skip(block)
