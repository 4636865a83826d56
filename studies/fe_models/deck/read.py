"""Reads a deck of CalculiX or Abaqus: which keywords are acted upon, skipped, or refused.

Keywords that are read stand with their readers (`keyword` in `draft`). All others but those that cannot change the
model are refused: they may change it.
"""

from __future__ import annotations

from pathlib import Path

from studies.fe_models.deck import contact_keywords, model_keywords, step_keywords
from studies.fe_models.deck.contents import Deck
from studies.fe_models.deck.draft import KEYWORDS, Draft, check_parameters
from studies.fe_models.deck.mesh import Mesh
from studies.fe_models.deck.mesh_keywords import read_mesh_keyword
from studies.fe_models.deck.model import Model
from studies.fe_models.text import Block, read_blocks

__all__ = ["HARMLESS", "KEYWORDS", "contact_keywords", "model_keywords", "read_deck", "step_keywords"]

_OUTPUT = """
OUTPUT NODEOUTPUT ELEMENTOUTPUT CONTACTOUTPUT ENERGYOUTPUT MODALOUTPUT INTEGRATEDOUTPUT RADIATIONOUTPUT NODEPRINT
ELPRINT CONTACTPRINT ENERGYPRINT FACEPRINT SECTIONPRINT MODALPRINT PRINT PREPRINT NODEFILE ELFILE CONTACTFILE ENERGYFILE
MODALFILE FILEFORMAT FILEOUTPUT MONITOR FILTER TIMEPOINTS MATRIXOUTPUT RESTART INCREMENTATIONOUTPUT DIAGNOSTICS
INTEGRATEDOUTPUTSECTION ELEMENTMATRIXOUTPUT SUBSTRUCTUREOUTPUT
"""
_HOW_STEPS_ARE_COMPUTED = """
CONTROLS SOLVERCONTROLS CONTACTCONTROLS SECTIONCONTROLS AMPLITUDE SELECTCYCLICSYMMETRYMODES SELECTEIGENMODES
MODALDAMPING BASEMOTION
"""
_HEAT_AND_DIRECTIONS = """
CONDUCTIVITY SPECIFICHEAT LATENTHEAT PHYSICALCONSTANTS FILM RADIATE CFLUX DFLUX SFILM DSFLUX GAPCONDUCTANCE ORIENTATION
"""  # strains by heat are refused, and materials are isotropic

HARMLESS = frozenset((_OUTPUT + _HOW_STEPS_ARE_COMPUTED + _HEAT_AND_DIRECTIONS).split())
"""Keywords that cannot change the model, in capitals without blanks. They are skipped and named."""

_INSTEAD = {
    **dict.fromkeys(("CONTACT", "CONTACTINCLUSIONS"), "give *CONTACT PAIR for the surfaces that touch"),
    "DAMPING": "remove it: the damping is loss_factor of the study",
    "EMBEDDEDELEMENT": "give *TIE, or meshes that share their nodes",
    "DISTRIBUTING": "write *KINEMATIC, or give the load on the surface",
    "PARAMETER": "write numbers in place of <names>",
    "PLASTIC": "remove it: materials are elastic",
    "PRE-TENSIONSECTION": "remove it, and give the force of the bolt with `preload` in the study",
}
"""Remedies for some of the others."""

_LOADS = ("CLOAD", "DSLOAD", "TEMPERATURE")  # of steps that are not static they do not matter


def read_deck(path: Path) -> Deck:
    """The model of a deck of CalculiX or Abaqus, in units of the file. Files that it includes are in its folder or
    below.

    Keywords that cannot change the model are named in `skipped`. Numbers of the first instance are those of its part;
    of the others they are so many thousands larger as a note says. Raises SceneError about "model" where the deck
    cannot be read, makes no sense, or has a keyword that may change the model and is not read.
    """
    draft = Draft(path.name)
    for block in read_blocks(path, draft.included):
        read_mesh_keyword(draft, block)
    if draft.part or draft.scope:
        raise block.place.wrong(f"the end of {draft.part or draft.scope} is missing", "write *END PART, *END INSTANCE")
    model = Model(Mesh(draft))
    for model.scope, block in draft.others:
        _read(model, block)
    model.end_step()
    model.check_coupling()
    return model.deck()


def _read(model: Model, block: Block) -> None:
    """Acts on a keyword, or skips it. Raises SceneError where it, or a parameter of it, may change the model."""
    if block.keyword not in ("KINEMATIC", "DISTRIBUTING"):
        model.check_coupling()
    known = KEYWORDS.get(block.keyword)
    unused = model.step is not None and not model.step.loads_count
    if block.keyword in HARMLESS or (unused and block.keyword in _LOADS):
        model.skip(block)
    elif known is None:
        remedy = _INSTEAD.get(block.keyword, "remove it if the model is right without it")
        raise block.place.wrong(f"*{block.written} is not read, and may change the model", remedy)
    else:
        if not (unused and block.keyword == "DLOAD"):
            check_parameters(known, block)
        known.reader(model, block)
