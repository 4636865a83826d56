"""Reads a deck of CalculiX or Abaqus.

A deck is read twice: first the keywords of the mesh, whose sets and surfaces may be named before they are defined;
then, with the mesh at hand, all others in the order of the file.
"""

from __future__ import annotations

from pathlib import Path

from studies.fe_models.deck import model_keywords, step_keywords
from studies.fe_models.deck.blocks import Block, read_blocks
from studies.fe_models.deck.contents import Deck
from studies.fe_models.deck.keywords import HARMLESS, KEYWORDS, find_keyword
from studies.fe_models.deck.mesh import Draft, Mesh
from studies.fe_models.deck.mesh_keywords import read_mesh_keyword
from studies.fe_models.deck.model import Model

# the table is complete once all its readers are loaded
__all__ = ["HARMLESS", "KEYWORDS", "model_keywords", "read_deck", "step_keywords"]

_LOADS = ("CLOAD", "DSLOAD", "TEMPERATURE")  # of steps that are not static they do not matter


def read_deck(path: Path) -> Deck:
    """The model of a deck of CalculiX or Abaqus, in units of the file, with the files that it includes.

    Numbers of the first instance are those of its part; of the others they are larger, as a note says. Raises
    SceneError about "model" where the deck makes no sense, or has what may change the model and is not read.
    """
    draft = Draft(path.name)
    for block in read_blocks(path, draft.included):
        read_mesh_keyword(draft, block)
    if draft.part or draft.scope:
        raise block.place.wrong(f"the end of {draft.part or draft.scope} is missing", "write *END PART, *END INSTANCE")
    model = Model(Mesh(draft))
    for block in draft.others:
        _read(model, block)
    model.end_step()
    _check_coupling(model)
    return model.deck()


def _read(model: Model, block: Block) -> None:
    """Acts on a keyword, or skips it. Raises SceneError where it, or a parameter of it, may change the model."""
    if block.keyword not in ("KINEMATIC", "DISTRIBUTING"):
        _check_coupling(model)
    unused = model.step is not None and not model.step.loads_count
    if block.keyword in HARMLESS or (unused and block.keyword in _LOADS):
        model.skip(block)
    else:
        find_keyword(block, any_parameters=unused and block.keyword == "DLOAD").reader(model, block)


def _check_coupling(model: Model) -> None:
    """Raises SceneError where a coupling does not say what it couples."""
    if model.coupling is not None:
        raise model.coupling.place.wrong("no *KINEMATIC below it", "write it there, or remove the coupling")
