"""The table of keywords: what reads each, with which parameters; keywords that are skipped, and those that are refused.

A keyword, and each of its parameters, is read, or stands in a list of those that cannot change the model, or is
refused: it may change the model.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from studies.fe_models.deck.blocks import Block
from studies.fe_models.files import shown

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

Reader = Callable[[Any, Block], None]
"""Acts on a keyword: takes the draft of the mesh, or the model of all others, and the keyword."""


@dataclass(frozen=True)
class Keyword:
    """A keyword that is read.

    parameters: names in capitals without blanks that the reader acts on; "*" stands for any. harmless: those that
    cannot change the model. of_mesh: whether it is read with the mesh, before all others.
    """

    reader: Reader
    parameters: frozenset[str]
    harmless: frozenset[str]
    of_mesh: bool


KEYWORDS: dict[str, Keyword] = {}
"""Keywords that are read, in capitals without blanks; the files of their readers fill it."""


def keyword(
    names: str, parameters: str = "", harmless: str = "", *, of_mesh: bool = False
) -> Callable[[Reader], Reader]:
    """Enters the reader of keywords into the table; several names have blanks between them."""

    def entered(reader: Reader) -> Reader:
        for name in names.split():
            KEYWORDS[name] = Keyword(reader, frozenset(parameters.split()), frozenset(harmless.split()), of_mesh)
        return reader

    return entered


def find_keyword(block: Block, *, any_parameters: bool = False) -> Keyword:
    """What reads a keyword. Raises SceneError where it, or one of its parameters, may change the model."""
    known = KEYWORDS.get(block.keyword)
    if known is None:
        remedy = _INSTEAD.get(block.keyword, "remove it if the model is right without it")
        raise block.place.wrong("this keyword is not read, and may change the model", remedy)
    for name in block.parameters:
        if not (any_parameters or {name, "*"} & known.parameters or name in known.harmless):
            found = f"{shown(name)} is not read, and may change the model"
            raise block.place.wrong(found, f"leave {shown(name)} out if the model is right without it")
    return known
