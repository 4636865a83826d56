"""Commands of a .cdb file: which are acted upon, which cannot change the model, and why others are refused."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from studies.fe_models.deck.mesh import Boundary
from studies.fe_models.text.read_errors import Place, shown

_LETTERS = 4  # of a command; what follows is left out by some programs


def _short(names: str) -> frozenset[str]:
    return frozenset(name[:_LETTERS] for name in names.split())


WITHOUT_INFLUENCE = _short(
    # comments, titles, what is printed and where the program stands
    "/COM /TITLE /STITLE /PREP7 /SOLU /POST1 /NOPR /GOPR /GO /OUT /OUTPUT /NERR /UNITS /VIEW /WB /BATCH FINISH EOF "
    # parameters and numbering
    "*SET *IF *ELSE *ENDIF *ELSEIF NUMOFF SHPP DOF CM CMSEL CMGRP CMDELE ALLSEL NSEL ESEL "
    # coordinate systems of elements and displays; nodes have angles of their own, which are looked at
    "CSYS DSYS RSYS ESYS LOCAL CSCIR "
    # attributes of elements; the material is that of the study
    "MAT TYPE REAL SECNUM TSHAP R RMORE RLBLOCK SECTYPE SECDATA SECOFFSET SECCONTROL SECCONTROLS SECBLOCK SECMODIF "
    "MP MPTEMP MPDATA MPDE UIMP TREF "
    # how an analysis is run and what it writes; the damping is that of the study
    "ANTYPE MODOPT MODCONTROL QRDOPT MXPAND EQSLV NLGEOM NROPT KBC TIME TIMINT NSUBST DELTIM AUTOTS NCNV NEQIT "
    "CNVTOL CUTCONTROL "
    "OUTRES OUTPR ERESX RESCONTROL RATE CRPLIM LNSRCH PRED KUSE IRLF LSCLEAR EXTOPT SOLCONTROL WRFULL HBMAT HROPT "
    "HROUT HARFRQ TRNOPT BUCOPT SUBOPT RIGID THOPT CGLOC ALPHAD BETAD DMPRAT DMPSTR MDAMP"
)
"""Commands that are skipped."""

_WHERE_ZERO = _short("OMEGA DOMEGA CGOMGA DCGOMG ACEL CMOMEGA CMDOMEGA CMACEL BFUNIF TUNIF")
"""Loads that CDWRITE writes in any case."""

_WITH_LABEL = _short("CMOMEGA CMDOMEGA CMACEL BFUNIF")
"""Those whose first field is no number."""

_PLAIN_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eEdD][+-]?\d+)?")
_DIRECTIONS = {"UX": (1, 1), "UY": (2, 2), "UZ": (3, 3), "ALL": (1, 3)}
_INTEGRATED, _LAYERED = 2, 3  # numbers of key options
_FREE = "export without constraint equations: CEDELE,ALL and CPDELE,ALL"
_LOADS = "delete it, and give `preload` in the study"
_REMEDIES = {
    **dict.fromkeys(_short("CE CEINTF CERIG CP CPINTF CPLGEN CECYC RBE3"), _FREE),
    **dict.fromkeys(_short("OMEGA DOMEGA CMOMEGA CGOMGA"), "delete it, and give `rotation_speed` and `axis`"),
    **dict.fromkeys(_short("PSTRES SSTIF INISTATE ISFILE"), "delete it, and give `rotation_speed`, or `matrices`"),
    **dict.fromkeys(_short("F SF SFE SFA BF BFE BFUNIF TUNIF ACEL CMACEL"), _LOADS),
    **dict.fromkeys(_short("N EN E EMORE"), "write nodes and elements in blocks: CDWRITE,DB,file,cdb"),
    "LUMP": "delete it: the mass is consistent",
    "CYCL": "delete it, and give `n_sectors` and `axis` in the study",
    "TB": "delete it, and give `material` in the study: isotropic and elastic",
}


@dataclass(frozen=True)
class CdbCommands:
    """Numbers of elements (185 of SOLID185) by their types, the line of each type, and displacements that are given."""

    kinds: dict[int, int]
    places: dict[int, Place]
    boundaries: tuple[Boundary, ...]


def read_commands(path: Path) -> CdbCommands:
    """What the commands of a file say beside its blocks of nodes, elements and components.

    Raises SceneError where a command that is not acted upon may change the model.
    """
    kinds: dict[int, int] = {}
    places: dict[int, Place] = {}
    held: dict[tuple[str, float], list[int]] = {}
    types_left = False
    for fields, place in _lines(path):
        command = fields[0][:_LETTERS]
        if command == "":  # a line of numbers
            if types_left and fields[1] == "-1":
                types_left = False
            elif types_left and fields[1].isdigit():
                _add_type(fields[1:], kinds, places, place, fields[3:])
            continue
        types_left = command == "ETBL"
        if command == "ET":
            _add_type(fields[1:], kinds, places, place, fields[3:])
        elif command == "KEYO":
            kind = kinds.get(int(fields[1])) if fields[1:] and fields[1].isdigit() else None
            if fields[3:4] == ["1"]:
                _refuse_option(kind, fields[2], place)
        elif command == "D":
            label, value, node = _displacement(fields, place)
            held.setdefault((label, value), []).append(node)
        elif command == "EBLO" and "SOLID" not in fields:
            raise place.wrong("EBLOCK without SOLID", "write the elements with CDWRITE,DB,file,cdb")
        elif not _is_skipped(command, fields):
            found = f"{shown(fields[0])} may change the model, and is not acted upon"
            raise place.wrong(found, _REMEDIES.get(command, "delete it if it does not"))
    boundaries = (
        Boundary(f"D,{label}", np.unique(nodes).astype(np.int64), *_DIRECTIONS[label], value)
        for (label, value), nodes in held.items()
    )
    return CdbCommands(kinds, places, tuple(boundaries))


def _lines(path: Path) -> Iterator[tuple[list[str], Place]]:
    """Fields in capitals and place of each command; of lines of numbers between ETBLOCK and its end behind a ""."""
    in_types = False
    with path.open(encoding="latin-1") as file:
        for number, text in enumerate(file, 1):
            start = text.lstrip()[:1]
            if start in "-.0123456789(!":
                if in_types and start not in "(!":
                    yield ["", *text.split()], Place(path.name, number)
                continue
            for each in [text] if start == "/" else text.split("!")[0].split("$"):  # titles may have a $
                fields = [field.strip().upper() for field in each.split("!")[0].split(",")]
                fields[0] = fields[0].split()[0] if fields[0] else ""
                in_types = fields[0][:_LETTERS] == "ETBL"
                if fields[0]:
                    yield fields, Place(path.name, number)


def _is_skipped(command: str, fields: list[str]) -> bool:
    if command in WITHOUT_INFLUENCE or command in ("ETBL", "NBLO", "EBLO", "CMBL") or "=" in fields[0]:
        return True
    if command in ("PSTR", "SSTI", "LUMP"):
        return fields[1:2] in (["OFF"], ["0"])
    if command in ("N", "EN"):  # the end of a block
        return fields[-1 if fields[-1] else -2] == "-1"
    # _TINY is the number that stands for no temperature
    values = [field for field in fields[2 if command in _WITH_LABEL else 1 :] if field not in ("", "_TINY")]
    return command in _WHERE_ZERO and all(
        _PLAIN_NUMBER.fullmatch(value) and not float(value.replace("D", "E")) for value in values
    )


def _add_type(
    fields: list[str], kinds: dict[int, int], places: dict[int, Place], place: Place, options: list[str]
) -> None:
    """fields: number of the type, and number or name of its elements. options: its key options from the first on."""
    name = re.search(r"\d+$", fields[1]) if len(fields) > 1 else None
    if name is None or not fields[0].isdigit():
        raise place.wrong("a type of elements that is no number", "write the file with CDWRITE,DB,file,cdb")
    kinds[int(fields[0])], places[int(fields[0])] = int(name[0]), place
    for option in (_INTEGRATED, _LAYERED):
        if options[option - 1 : option] == ["1"]:
            _refuse_option(int(name[0]), str(option), place)


def _refuse_option(kind: int | None, option: str, place: Place) -> None:
    """Raises SceneError where a key option of 1 makes other elements of a kind than those that are read."""
    if option == str(_LAYERED) and kind in (185, 186, 190):
        raise place.wrong("elements of layers (key option 3)", "use homogeneous solid elements")
    if option == str(_INTEGRATED) and kind in (45, 185):
        raise place.wrong("elements of reduced integration (key option 2)", "use full integration, or enhanced strains")


def _displacement(fields: list[str], place: Place) -> tuple[str, float, int]:
    """Label, value and node of a command D."""
    fields = [*fields, *[""] * 8]
    node, label, value = fields[1:4]
    plain = node.isdigit() and label in _DIRECTIONS and (not value or _PLAIN_NUMBER.fullmatch(value))
    if not plain or any(fields[5:]):
        found = f"D of {shown(node)}, {shown(label)} = {shown(value)}"
        raise place.wrong(found, "delete it, and give `clamp` in the study: nodes with UX, UY, UZ or ALL are read")
    return label, float(value.replace("D", "E") or 0.0), int(node)
