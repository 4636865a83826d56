"""Reads a deck of CalculiX or Abaqus: keyword by keyword into a draft, whose names are then looked up."""

from __future__ import annotations

from pathlib import Path

from studies.fe_models.deck.draft import Draft, refused
from studies.fe_models.deck.generate import read_placement
from studies.fe_models.deck.keywords import read_keyword
from studies.fe_models.deck.mesh import Deck
from studies.fe_models.deck.resolve import resolve
from studies.fe_models.text.keyword_lines import Block, read_blocks, read_name
from studies.fe_models.text.read_errors import shown

_OF_PARTS = ("PART", "ENDPART", "INSTANCE", "ENDINSTANCE")


def read_deck(path: Path) -> Deck:
    """The model of a deck of CalculiX or Abaqus.

    path: the deck. Files that it includes stand in its folder or below.

    Returns Deck: In units of the file. Keywords that cannot change the model are named in `skipped`. Numbers of nodes
    and elements are those of the file. Where the deck has instances, those of the first one are those of its part; of
    the others they are so many thousands larger as a note says.

    Raises SceneError about "model": in one sentence with file and line, where the deck cannot be read, makes no sense,
    or has a keyword that may change the model and is not read.
    """
    reading = _Reading(Draft(path.name))
    for block in read_blocks(path, reading.draft.included):
        reading.take(block)
    draft = reading.draft
    draft.end_step()
    if draft.coupling is not None:
        raise refused(draft.coupling, "no *KINEMATIC below it", "write it there, or remove the coupling")
    if draft.part or draft.scope:
        raise block.place.wrong(f"the end of {draft.part or draft.scope} is missing", "write *END PART, *END INSTANCE")
    return resolve(draft)


class _Reading:
    def __init__(self, draft: Draft) -> None:
        self.draft = draft

    def take(self, block: Block) -> None:
        """The next keyword of the file: of a part it is put aside until there is an instance."""
        draft = self.draft
        if block.keyword in _OF_PARTS:
            for name in block.parameters:
                if name not in ("NAME", "PART", "NSET", "ELSET"):
                    raise block.place.wrong(f"*{block.written} with {shown(name)} is not read", "leave it out")
            getattr(self, f"_{block.keyword.lower()}")(block)
        elif draft.part:
            draft.parts[draft.part].append(block)
        else:
            read_keyword(draft, block)

    def _part(self, block: Block) -> None:
        name = block.name("NAME")
        if self.draft.part or self.draft.scope or name in self.draft.parts:
            raise block.place.wrong(f"*PART {shown(name)} again, or within another", "write *END PART above it")
        self.draft.part, self.draft.parts[name] = name, []

    def _endpart(self, _block: Block) -> None:
        self.draft.part = ""

    def _instance(self, block: Block) -> None:
        """*INSTANCE: the mesh of the part, shifted and turned."""
        draft = self.draft
        name, part = block.name("NAME"), block.name("PART")
        if part not in draft.parts or draft.part or draft.scope or name in draft.placed:
            found = f"*INSTANCE {shown(name)} of {shown(part)}, which is no part, or again"
            raise block.place.wrong(found, "give *PART above it, and each instance once")
        draft.placed[name] = read_placement(block)
        draft.scope, draft.system = name, draft.world
        for each in draft.parts[part]:
            read_keyword(draft, each)
        # sets of the assembly with all of the instance
        for parameter, sets in (("NSET", draft.node_sets), ("ELSET", draft.element_sets)):
            if parameter in block.parameters:
                sets.add_all("", read_name(block.parameters[parameter]), name)

    def _endinstance(self, _block: Block) -> None:
        self.draft.scope, self.draft.system = "", self.draft.world
