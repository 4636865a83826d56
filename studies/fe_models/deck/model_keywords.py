"""Keywords between mesh and steps: ties, contact pairs, cyclic symmetry, materials and sections."""

from __future__ import annotations

import numpy as np

from studies.fe_models.deck.draft import Draft, DraftMaterial, DraftPair
from studies.fe_models.deck.sets import read_reference
from studies.fe_models.text.keyword_lines import Block, read_name
from studies.fe_models.text.numbers import is_integer, read_fields, read_float, read_floats
from studies.fe_models.text.read_errors import shown

_MOST_SECTORS = 100_000


def read_tie(draft: Draft, block: Block) -> None:
    """*TIE: dependent and independent surface; with CYCLIC SYMMETRY the cut faces of a sector."""
    if "MULTISTAGE" in block.parameters:
        draft.skip(block, ", MULTISTAGE")
        return
    tolerance = None
    if "POSITIONTOLERANCE" in block.parameters:
        given = read_float(block.parameters["POSITIONTOLERANCE"], block.place)
        tolerance = given if given > 0 else None
    cyclic = "CYCLICSYMMETRY" in block.parameters
    draft.ties.extend(read_pairs(draft, block, read_name(block.parameters.get("NAME", "")), tolerance, cyclic))


def read_contact_pair(draft: Draft, block: Block) -> None:
    """*CONTACT PAIR: dependent and independent surface."""
    draft.contact_pairs.extend(read_pairs(draft, block, read_name(block.parameters.get("INTERACTION", ""))))


def read_pairs(
    draft: Draft, block: Block, name: str, tolerance: float | None = None, cyclic: bool = False
) -> list[DraftPair]:
    """The two surfaces of each data line."""
    pairs: list[DraftPair] = []
    for line in range(len(block.lines)):
        place = block.place_of(line)
        fields = read_fields(block, line)
        if len(fields) < 2:
            raise place.wrong(f"one surface below *{block.written}", "give the dependent and the independent surface")
        dependent, independent = (read_reference(part, draft.scope, draft.instance, place) for part in fields[:2])
        pairs.append(DraftPair(dependent, independent, name, place, tolerance, cyclic))
    if not pairs:
        raise block.place.wrong(f"*{block.written} without surfaces", "give two surfaces below it")
    return pairs


def read_interaction(draft: Draft, block: Block) -> None:
    """*SURFACE INTERACTION: what follows is about it."""
    draft.interaction = block.name("NAME")


def read_friction(draft: Draft, block: Block) -> None:
    """*FRICTION: the coefficient of an interaction; of several lines the first."""
    if not draft.interaction or draft.step is not None or not block.lines:
        draft.skip(block)
        return
    value = read_floats(block, 0, 1)[0]
    if value < 0:
        raise block.place_of(0).wrong(f"a friction coefficient of {value:g}", "give one of at least 0")
    draft.frictions[draft.interaction] = value


def read_cyclic_symmetry(draft: Draft, block: Block) -> None:
    """*CYCLIC SYMMETRY MODEL: number of sectors, and two points on the axis."""
    number = block.parameters.get("N", "").strip()
    if not is_integer(number) or not 1 <= int(number) <= _MOST_SECTORS:
        raise block.place.wrong(f"N={shown(number)}", f"give a number of sectors from 1 to {_MOST_SECTORS}")
    axis = np.array(read_floats(block, 0, 6)[:6]).reshape(2, 3)
    if not 0 < np.linalg.norm(axis[1] - axis[0]) < np.inf:
        raise block.place_of(0).wrong("two equal points on the axis", "give two points that are apart")
    if draft.cyclic is not None:
        raise block.place.wrong("a second *CYCLIC SYMMETRY MODEL", "keep one: several stages are not supported")
    draft.cyclic = (int(number), read_name(block.parameters.get("TIE", "")), axis, block.place)


def read_material(draft: Draft, block: Block) -> None:
    """*MATERIAL: what follows is about it."""
    draft.material = draft.materials.setdefault(block.name("NAME"), DraftMaterial())


def read_elastic(draft: Draft, block: Block) -> None:
    """*ELASTIC: Young's modulus and Poisson's ratio, those of the first temperature."""
    if block.parameters.get("TYPE", "ISO").upper() not in ("ISO", "ISOTROPIC"):
        draft.skip(block, f", TYPE={shown(block.parameters['TYPE'])}")
        return
    if draft.material is None:
        raise block.place.wrong("*ELASTIC without a material", "write *MATERIAL, NAME=... above it")
    young, poisson = read_floats(block, 0, 2)[:2]
    if not young > 0 or not -1 < poisson < 0.5:
        found = f"Young's modulus {young:g} and Poisson's ratio {poisson:g}"
        raise block.place_of(0).wrong(found, "give a positive modulus, and a ratio between -1 and 0.5")
    draft.material.young, draft.material.poisson = young, poisson


def read_density(draft: Draft, block: Block) -> None:
    """*DENSITY, that of the first temperature."""
    if draft.material is None:
        raise block.place.wrong("*DENSITY without a material", "write *MATERIAL, NAME=... above it")
    density = read_floats(block, 0, 1)[0]
    if not density > 0:
        raise block.place_of(0).wrong(f"a density of {density:g}", "give a positive one")
    draft.material.density = density


def read_section(draft: Draft, block: Block) -> None:
    """*SOLID SECTION: a set of elements and its material."""
    name = block.name("ELSET")
    reference = read_reference(f'"{name}"', draft.scope, draft.instance, block.place)
    draft.sections.append((reference, block.name("MATERIAL")))
