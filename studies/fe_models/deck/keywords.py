"""Which keywords are read, with which parameters, and which ones cannot change the model.

All others are refused: they may change it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from studies.fe_models.deck import constraint_keywords as constraints
from studies.fe_models.deck import contact_keywords as contact
from studies.fe_models.deck import generate, mesh_keywords
from studies.fe_models.deck import material_keywords as materials
from studies.fe_models.deck import step_keywords as steps
from studies.fe_models.deck.draft import Draft, refused
from studies.fe_models.text.keyword_lines import Block
from studies.fe_models.text.read_errors import shown

Reader = Callable[[Draft, Block], None]


@dataclass(frozen=True)
class Keyword:
    """A keyword that is read.

    parameters: names in capitals without blanks that the reader acts on. harmless: those that cannot change the model.
    """

    reader: Reader
    parameters: frozenset[str]
    harmless: frozenset[str]


def _read(reader: Reader, parameters: str = "", harmless: str = "") -> Keyword:
    return Keyword(reader, frozenset(parameters.split()), frozenset(harmless.split()))


PROCEDURES = (
    *("STATIC", "FREQUENCY", "DYNAMIC", "BUCKLE", "COMPLEXFREQUENCY", "GREEN", "HEATTRANSFER", "MATRIXGENERATE"),
    *("MODALDYNAMIC", "STEADYSTATEDYNAMICS", "SUBSTRUCTUREGENERATE", "VISCO", "NOANALYSIS"),
    *("COUPLEDTEMPERATURE-DISPLACEMENT", "UNCOUPLEDTEMPERATURE-DISPLACEMENT"),
)
"""Keywords that say what a step computes; their parameters and data do not matter."""

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

_LOAD = "OP AMPLITUDE"
_LOADS = ("CLOAD", "DSLOAD", "TEMPERATURE")  # of steps that are not static they do not matter

KEYWORDS: Mapping[str, Keyword] = {
    "ASSEMBLY": _read(steps.read_nothing, "", "NAME"),
    "BEAMSECTION": _read(materials.read_other_section, "ELSET", "MATERIAL SECTION ORIENTATION OFFSET1 OFFSET2"),
    "BOUNDARY": _read(steps.read_boundary, "OP TYPE LOADCASE FIXED", "AMPLITUDE"),
    "CLEARANCE": _read(contact.read_clearance, "MASTER SLAVE VALUE"),
    "CLOAD": _read(steps.read_cload, _LOAD),
    "CONTACTINTERFERENCE": _read(contact.read_interference, "SHRINK TYPE AMPLITUDE", "OP"),
    "CONTACTPAIR": _read(
        contact.read_contact_pair,
        "INTERACTION TIED ADJUST",
        "TYPE SMALLSLIDING EXTENSIONZONE HCRIT SMOOTH TRACKING CPSET MINIMUMDISTANCE WEIGHT",
    ),
    "COUPLING": _read(constraints.read_coupling, "REFNODE SURFACE", "CONSTRAINTNAME"),
    "CYCLICSYMMETRYMODEL": _read(contact.read_cyclic_symmetry, "N TIE", "NGRAPH ELSET CHECK"),
    "DASHPOT": _read(materials.read_other_section, "ELSET"),
    "DENSITY": _read(materials.read_density),
    "DLOAD": _read(steps.read_dload, _LOAD),
    "DSLOAD": _read(steps.read_dsload, _LOAD),
    "ELASTIC": _read(materials.read_elastic, "TYPE DEPENDENCIES", "MODULI"),
    "ELCOPY": _read(generate.read_elcopy, "ELEMENTSHIFT SHIFTNODES OLDSET NEWSET"),
    "ELEMENT": _read(mesh_keywords.read_element, "TYPE ELSET INPUT"),
    "ELGEN": _read(generate.read_elgen, "ELSET"),
    "ELSET": _read(mesh_keywords.read_elset, "ELSET GENERATE INSTANCE INPUT UNSORTED", "INTERNAL"),
    "ENDASSEMBLY": _read(steps.read_nothing),
    "ENDSTEP": _read(steps.read_end_step),
    "EQUATION": _read(constraints.read_equation, "REMOVE REMOVEALL"),
    "EXPANSION": _read(materials.read_thermal, "", "TYPE ZERO"),
    "FRICTION": _read(
        contact.read_friction,
        "ROUGH TAUMAX EXPONENTIALDECAY ANISOTROPIC USER DEPENDENCIES PROPERTIES",
        "SLIPTOLERANCE ELASTICSLIP LAGRANGE SHEARTRACTIONSLOPE",
    ),
    "HEADING": _read(steps.read_nothing),
    "INITIALCONDITIONS": _read(materials.read_initial_conditions, "TYPE"),
    "KINEMATIC": _read(constraints.read_kinematic),
    "KINEMATICCOUPLING": _read(constraints.read_kinematic_coupling, "REFNODE"),
    "MASS": _read(materials.read_other_section, "ELSET"),
    "MATERIAL": _read(materials.read_material, "NAME"),
    "MEMBRANESECTION": _read(materials.read_other_section, "ELSET", "MATERIAL"),
    "MODELCHANGE": _read(contact.read_model_change, "TYPE REMOVE ADD"),
    "MPC": _read(constraints.read_mpc),
    "NCOPY": _read(generate.read_ncopy, "CHANGENUMBER OLDSET NEWSET SHIFT"),
    "NFILL": _read(generate.read_nfill, "NSET"),
    "NGEN": _read(generate.read_ngen, "NSET LINE"),
    "NODE": _read(mesh_keywords.read_node, "NSET SYSTEM INPUT"),
    "NSET": _read(mesh_keywords.read_nset, "NSET ELSET GENERATE INSTANCE INPUT UNSORTED", "INTERNAL"),
    "RIGIDBODY": _read(constraints.read_rigid_body, "NSET ELSET PINNSET TIENSET REFNODE ROTNODE", "ISOTHERMAL"),
    "SHELLSECTION": _read(materials.read_other_section, "ELSET", "MATERIAL OFFSET ORIENTATION"),
    "SOLIDSECTION": _read(materials.read_section, "ELSET MATERIAL", "ORIENTATION CONTROLS"),
    "SPRING": _read(materials.read_other_section, "ELSET"),
    "STEP": _read(
        steps.read_step, "", "PERTURBATION NLGEOM NAME INC UNSYMM AMPLITUDE CONVERTSDI EXTRAPOLATION SOLVER DIRECT"
    ),
    "SURFACE": _read(mesh_keywords.read_surface, "NAME TYPE", "INTERNAL"),
    "SURFACEBEHAVIOR": _read(
        contact.read_behavior, "PRESSURE-OVERCLOSURE", "PENALTY AUGMENTEDLAGRANGE DIRECT STIFFNESS"
    ),
    "SURFACEINTERACTION": _read(contact.read_interaction, "NAME"),
    "SYSTEM": _read(mesh_keywords.read_system),
    "TEMPERATURE": _read(materials.read_thermal, "", "OP AMPLITUDE FILE BSTEP BINC ESTEP EINC INTERPOLATE USER"),
    "TIE": _read(
        contact.read_tie, "NAME POSITIONTOLERANCE CYCLICSYMMETRY", "ADJUST TYPE NOROTATION NOTHICKNESS CONSTRAINTRATIO"
    ),
    "TRANSFORM": _read(constraints.read_transform, "NSET TYPE"),
    **dict.fromkeys(PROCEDURES, _read(steps.read_procedure, "*")),
}
"""Keywords that are read, in capitals without blanks. "*" stands for any parameter."""


def read_keyword(draft: Draft, block: Block) -> None:
    """Acts on a keyword, or skips it. Raises SceneError where it, or a parameter of it, may change the model."""
    if draft.coupling is not None and block.keyword not in ("KINEMATIC", "DISTRIBUTING"):
        raise refused(draft.coupling, "no *KINEMATIC below it", "write it there, or remove the coupling")
    known = KEYWORDS.get(block.keyword)
    if known is None:
        if block.keyword in HARMLESS:
            draft.skip(block)
            return
        remedy = _INSTEAD.get(block.keyword, "remove it if the model is right without it")
        raise block.place.wrong(f"*{block.written} is not read, and may change the model", remedy)
    unused = draft.step is not None and not draft.step.loads_count
    if unused and block.keyword in _LOADS:
        draft.skip(block)
        return
    if "*" not in known.parameters and not (unused and block.keyword == "DLOAD"):
        for name in block.parameters:
            if name not in known.parameters and name not in known.harmless:
                found = f"*{block.written} with {shown(name)}, which is not read and may change the model"
                raise block.place.wrong(found, f"leave {shown(name)} out if the model is right without it")
    known.reader(draft, block)
