"""Meshes of ANSYS (`CDWRITE, DB, model, cdb`) by ansys-mapdl-reader, and what their commands say.

Commands that may change the model and are not acted upon are refused.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from studies.fe_models.deck.contents import Deck, NodalValue
from studies.fe_models.deck.model import deck_of_arrays
from studies.fe_models.files import IntArray, Place, library_errors, shown, to_float
from studies.scene_error import SceneError

# which of the nodes of an element of ANSYS are those of which kind: bricks may be collapsed to wedges or tetrahedra
_BRICK = {
    8: (("C3D4", (0, 1, 2, 4), ((2, 3), (4, 5), (4, 6), (4, 7))), ("C3D6", (0, 1, 2, 4, 5, 6), ((2, 3), (6, 7)))),
    20: (
        ("C3D10", (0, 1, 2, 4, 8, 9, 11, 16, 17, 18), ((2, 3), (4, 5), (4, 6), (4, 7))),
        ("C3D15", (0, 1, 2, 4, 5, 6, 8, 9, 11, 12, 13, 15, 16, 17, 18), ((2, 3), (6, 7))),
    ),
}
# numbers of nodes of the solid elements that are read, by the number in their names
_TYPES = {45: 8, 185: 8, 95: 20, 186: 20, 92: 10, 187: 10, 285: 4}
_WHOLE = {8: "C3D8I", 20: "C3D20R", 10: "C3D10", 4: "C3D4"}
_PASSED_OVER = (151, 152, 153, 154, 156, 200)  # without a stiffness of their own: surface effects, and those that mesh
_HEADER = 10  # numbers of an element before its nodes
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

_BLOCKS = ("ETBL", "NBLO", "EBLO", "CMBL")  # what the library reads
_WHERE_ZERO = _short("OMEGA DOMEGA CGOMGA DCGOMG ACEL CMOMEGA CMDOMEGA CMACEL BFUNIF TUNIF")  # CDWRITE writes them
_WITH_LABEL = _short("CMOMEGA CMDOMEGA CMACEL BFUNIF")  # of these the first field is no number
_DIRECTIONS = {"UX": (1, 1), "UY": (2, 2), "UZ": (3, 3), "ALL": (1, 3)}
# key options of 1 that make other elements of some kinds than those that are read
_OPTIONS = {
    "2": ((45, 185), "elements of reduced integration (key option 2)", "use full integration, or enhanced strains"),
    "3": ((185, 186, 190), "elements of layers (key option 3)", "use homogeneous solid elements"),
}
_ELEMENTS = f"use solid elements: {', '.join(map(str, sorted(_TYPES)))}; delete contact elements (169 to 178: EDELE)"
_REMEDY = (
    "delete it, and give rotation_speed, axis, n_sectors, material, preload or matrices in the study where it matters"
)
_FREE = "export without constraint equations: CEDELE,ALL and CPDELE,ALL"
_IN_BLOCKS = "write nodes and elements in blocks: CDWRITE,DB,file,cdb"
_AGAIN = "let ANSYS read the file and write it again, in the form EBLOCK,19,SOLID: CDWRITE,DB,file,cdb"
_REMEDIES = {
    **dict.fromkeys(_short("CE CEINTF CERIG CP CPINTF CPLGEN CECYC RBE3"), _FREE),
    **dict.fromkeys(_short("N EN E EMORE"), _IN_BLOCKS),
}


@dataclass
class _Commands:
    """Numbers of elements (185 of SOLID185) with their line by types, and nodes that are held by label and value."""

    kinds: dict[int, tuple[int, Place]] = field(default_factory=dict)
    held: dict[tuple[str, float], list[int]] = field(default_factory=dict)


def read_cdb(path: Path) -> Deck:
    """The mesh of a .cdb file with the displacements that it holds. Raises SceneError."""
    with library_errors(path, "ansys.mapdl.reader", "ansys-mapdl-reader", "model"):
        commands = _read_commands(path)  # what cannot be read needs no library
        from ansys.mapdl import reader

        return _deck(path, reader.Archive(str(path), parse_vtk=False), commands)


def _deck(path: Path, archive: Any, commands: _Commands) -> Deck:
    if np.any(archive.node_angles):
        found = f"{path.name} has nodes with coordinate systems of their own"
        raise SceneError("model", found, "write it with NROTAT to the global one: its directions are x, y and z")
    rows: dict[str, list[tuple[int, IntArray]]] = {}
    passed: set[int] = set()
    materials: set[int] = set()
    for element in archive.elem:
        kind, place = commands.kinds.get(int(element[1]), (0, Place(path.name, 1)))
        if kind in _PASSED_OVER:
            passed.add(kind)
            continue
        if kind not in _TYPES:
            raise place.wrong(f"elements of type {kind or 'unknown'}", _ELEMENTS)
        # without any midside node an element is written by its corners
        name, chosen = _sort_out(np.trim_zeros(np.asarray(element[_HEADER:], dtype=np.int64)[: _TYPES[kind]], "b"))
        if not name or chosen.min() < 1:
            remedy = "mesh with whole hexahedra, wedges and tetrahedra, with all their midside nodes or none"
            raise SceneError("model", f"{path.name}: element {int(element[8])} has an unusual shape", remedy)
        rows.setdefault(name, []).append((int(element[8]), chosen))
        materials.add(int(element[0]))
    several = f"{path.name} has materials {' and '.join(map(str, sorted(materials)))}, of which the study gives one"
    nodes = np.asarray(archive.nnum, dtype=np.int64), np.asarray(archive.nodes, dtype=np.float64)[:, :3]
    blocks = [(name, np.array([n for n, _ in found]), np.stack([e for _, e in found])) for name, found in rows.items()]
    sets = archive.node_components.items(), archive.element_components.items()
    deck = deck_of_arrays(path.name, nodes, blocks, *sets)
    return replace(
        deck,
        boundaries=tuple(
            NodalValue(f"{path.name}: D", np.unique(held).astype(np.int64), *_DIRECTIONS[label], value)
            for (label, value), held in commands.held.items()
        ),
        notes=tuple(f"Elements of type {kind} are passed over." for kind in sorted(passed)),
        unassembled=(several,) if len(materials) > 1 else (),
    )


def _sort_out(nodes: IntArray) -> tuple[str, IntArray]:
    """Kind and nodes of an element; "" where it is a pyramid, or some of its midside nodes are missing."""
    for name, chosen, equal in _BRICK.get(nodes.size, ()):
        if all(nodes[one] == nodes[other] for one, other in equal):
            return name, nodes[list(chosen)]
    corners = nodes[: 8 if nodes.size in _BRICK else 4]
    return (_WHOLE.get(nodes.size, "") if np.unique(corners).size == corners.size else ""), nodes


def _read_commands(path: Path) -> _Commands:
    """What the commands of a file say beside its blocks. Raises SceneError where one may change the model otherwise."""
    found = _Commands()
    types_left = False
    for fields, place in _lines(path):
        command = fields[0][:_LETTERS]
        if command == "":  # a line of numbers
            types_left = types_left and fields[1] != "-1"
            if types_left and fields[1].isdigit():
                _add_type(found, fields[1:], place)
            continue
        types_left = command == "ETBL"
        if command == "ET":
            _add_type(found, fields[1:], place)
        elif command == "KEYO":
            number, option, value, *_ = [*fields[1:], "", "", ""]
            _check_option(found.kinds.get(int(number) if number.isdigit() else 0, (0, place))[0], option, value, place)
        elif command == "D":
            node, label, value, *more = [*fields[1:], *[""] * 8]
            moved = to_float(value or "0")
            if not node.isdigit() or label not in _DIRECTIONS or any(more[1:]) or math.isnan(moved):
                remedy = "delete it, and give `clamp` in the study: nodes with UX, UY, UZ or ALL are read"
                raise place.wrong(f"D of {shown(node)}, {shown(label)} = {shown(value)}", remedy)
            found.held.setdefault((label, moved), []).append(int(node))
        elif command == "EBLO" and "SOLID" not in fields:
            raise place.wrong(f"{shown(','.join(fields))}: elements in this form are not read", _AGAIN)
        elif not _is_skipped(command, fields):
            raise place.wrong(f"{shown(fields[0])} may change the model", _REMEDIES.get(command, _REMEDY))
    return found


def _add_type(found: _Commands, fields: list[str], place: Place) -> None:
    """fields: number of the type, number or name of its elements, and its key options from the first on."""
    name = re.search(r"\d+$", fields[1]) if len(fields) > 1 else None
    if name is None or not fields[0].isdigit():
        raise place.wrong("a type of elements that is no number", _IN_BLOCKS)
    found.kinds[int(fields[0])] = int(name[0]), place
    for option, value in enumerate(fields[2:], 1):
        _check_option(int(name[0]), str(option), value, place)


def _check_option(kind: int, option: str, value: str, place: Place) -> None:
    kinds, what, remedy = _OPTIONS.get(option, ((), "", ""))
    if value == "1" and kind in kinds:
        raise place.wrong(what, remedy)


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
                fields = [part.strip().upper() for part in each.split("!")[0].split(",")]
                fields[0] = fields[0].split()[0] if fields[0] else ""
                in_types = fields[0][:_LETTERS] == "ETBL"
                if fields[0]:
                    yield fields, Place(path.name, number)


def _is_skipped(command: str, fields: list[str]) -> bool:
    if command in WITHOUT_INFLUENCE or command in _BLOCKS or "=" in fields[0]:
        return True
    if command in ("PSTR", "SSTI", "LUMP"):
        return fields[1:2] in (["OFF"], ["0"])
    if command in ("N", "EN"):  # the end of a block
        return fields[-1 if fields[-1] else -2] == "-1"
    # _TINY is the number that stands for no temperature
    values = [part for part in fields[2 if command in _WITH_LABEL else 1 :] if part not in ("", "_TINY")]
    return command in _WHERE_ZERO and all(to_float(value) == 0.0 for value in values)
