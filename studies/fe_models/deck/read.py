"""Reads a deck of CalculiX or Abaqus: keyword by keyword into a draft, which is then looked through and frozen."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from studies.fe_models.deck.draft import Draft
from studies.fe_models.deck.finish import finish
from studies.fe_models.deck.mesh import Deck
from studies.fe_models.deck.mesh_keywords import (
    read_element,
    read_elset,
    read_end_of_scope,
    read_instance,
    read_node,
    read_nothing,
    read_nset,
    read_part,
    read_surface,
)
from studies.fe_models.deck.model_keywords import (
    read_contact_pair,
    read_cyclic_symmetry,
    read_density,
    read_elastic,
    read_friction,
    read_interaction,
    read_material,
    read_section,
    read_tie,
)
from studies.fe_models.deck.step_keywords import (
    PROCEDURES,
    read_boundary,
    read_dload,
    read_end_step,
    read_equation,
    read_model_change,
    read_procedure,
    read_step,
)
from studies.fe_models.text.keyword_lines import Block, read_blocks

_READERS: Mapping[str, Callable[[Draft, Block], None]] = {
    "ASSEMBLY": read_nothing,
    "BOUNDARY": read_boundary,
    "CONTACTPAIR": read_contact_pair,
    "CYCLICSYMMETRYMODEL": read_cyclic_symmetry,
    "DENSITY": read_density,
    "DLOAD": read_dload,
    "ELASTIC": read_elastic,
    "ELEMENT": read_element,
    "ELSET": read_elset,
    "ENDASSEMBLY": read_nothing,
    "ENDINSTANCE": read_end_of_scope,
    "ENDPART": read_end_of_scope,
    "ENDSTEP": read_end_step,
    "EQUATION": read_equation,
    "FRICTION": read_friction,
    "HEADING": read_nothing,
    "INSTANCE": read_instance,
    "MATERIAL": read_material,
    "MODELCHANGE": read_model_change,
    "NODE": read_node,
    "NSET": read_nset,
    "PART": read_part,
    "SOLIDSECTION": read_section,
    "STEP": read_step,
    "SURFACE": read_surface,
    "SURFACEINTERACTION": read_interaction,
    "TIE": read_tie,
    **dict.fromkeys(PROCEDURES, read_procedure),
}

_LONG = ("NODE", "ELEMENT", "NSET", "ELSET")
_MOST_LINES = 300_000  # of all other keywords that are read: a surface of so many faces takes seconds


def read_deck(path: Path) -> Deck:
    """The model of a deck of CalculiX or Abaqus, with those keywords that the project knows.

    Parameters
    ----------
    path
        The deck. Files that it includes stand in its folder or below.

    Returns
    -------
    Deck
        In units of the file. Other keywords are named in `skipped`. Numbers of nodes and elements are those of the
        file; where the deck has a part and its instance, those of the part, at the place of the instance.

    Raises
    ------
    SceneError
        About "model": in one sentence with file and line, where the deck cannot be read or makes no sense.
    """
    draft, left = Draft(), _MOST_LINES
    for block in read_blocks(path, draft.included):
        reader = _READERS.get(block.keyword)
        if reader is None:
            draft.skip(block)
            continue
        left -= 0 if block.keyword in _LONG else len(block.lines)
        if left < 0:
            remedy = "name what is meant by sets of nodes or elements"
            raise block.place.wrong(f"more than {_MOST_LINES} lines below *{block.written} and others", remedy)
        reader(draft, block)
    return finish(draft, path.name)
