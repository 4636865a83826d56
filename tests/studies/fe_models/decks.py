"""Decks that the tests write, after the manuals of CalculiX and Abaqus; glued frequencies of two of them."""

import random
import re
from pathlib import Path

import numpy as np

from studies.fe_models.from_files.model import find_files, load_model
from studies.fe_models.from_files.parameters import Parameters
from studies.finite_element.reduced_joint import prepare_model
from tests.studies.fe_models.solid_meshes import run_ccx

SECTOR = Path(__file__).parent / "calculix_sector.inp"
"""A deck of 12 sectors that CalculiX runs: a root that is tied, a centrifugal prestress, and the export of matrices."""

CUBES, PART, BLOCKS, SECTORS = (
    SECTOR.with_name(f"{name}.inp").read_text(encoding="ascii") for name in ("cubes", "part", "blocks", "ring")
)
"""Two cubes of different kinds, with all that a deck may hold; a part and its instance, as Abaqus writes them; two
blocks of 40 by 10 by 5 mm on each other, the lower one held at its left end; a disk and a rim on it, each a sector of
twelve with cut faces of its own, where nothing is held.
"""


def write(folder: Path, text: str, name: str = "deck.inp") -> Path:
    """A deck in a folder."""
    path = folder / name
    path.write_bytes(text.encode("latin-1"))
    return path


def prepared_deck(folder, text, nodal_diameter=0, **given):
    """The model of a deck, ready for its reduction."""
    write(folder, text)
    load = {"set": "TIP", "direction": (0, 1, 0)}
    parameters = Parameters(units="mm-t-s", load=load, nodal_diameter=nodal_diameter, **given)
    loaded = load_model(find_files(folder, "deck.inp", parameters), parameters)
    return prepare_model(loaded.model, loaded.joint), loaded


def frequencies(folder, text, nodal_diameter=0, **given):
    """The four lowest glued frequencies of a deck, Hz."""
    return prepared_deck(folder, text, nodal_diameter, **given)[0].frequencies(nodal_diameter, 4)


def run_tied(folder, text, step):
    """Runs CalculiX on a deck whose contact pairs are glued; the name of its files."""
    contact = r"\*SURFACE INTERACTION.*?\n\*CONTACT PAIR[^\n]*\n([^\n]*)\n"
    tied = re.sub(contact, r"*TIE, NAME=GLUE, POSITION TOLERANCE=0.1\n\1\n", text, flags=re.DOTALL)
    return run_ccx(folder, (tied + step).splitlines())


def listed_frequencies(job):
    """All natural frequencies, Hz, that a run of CalculiX has printed."""
    number = r"(-?\d\.\d+E[+-]\d+)"
    table = job.with_suffix(".dat").read_text()
    rows = re.findall(rf"^ +\d+ +(?:\d+ +)?{number} +{number} +{number} +{number} *$", table, re.MULTILINE)
    return np.array([float(row[2]) for row in rows])


def of_calculix(folder, text, step="*STEP\n*FREQUENCY\n4\n*END STEP\n", every=1):
    """Those that CalculiX finds, where contact pairs are glued. every: of how many equal ones one is taken."""
    return listed_frequencies(run_tied(folder, text, step))[: 4 * every : every]


# --- mutations: what a damaged or hostile copy of a good file may look like ---

_NUMBERS = (
    *("0", "-1", "1e999", "nan", "inf", "-inf", "1e-320", "99999999999999999999", "2147483648", "4294967296", "1_0"),
    *("", " ", "1.5", "0x10", "1.0D+400", "٣", "*", "**", ",,,,", '"', "=", "1e36", "9223372036854775807", "-0"),
)


def mutate(text: bytes, seed: int) -> bytes:
    """One of many damages, the same for the same seed."""
    chance = random.Random(seed)
    changed = bytearray(text)
    kind = chance.randrange(7)
    if kind == 0:
        return bytes(changed[: chance.randrange(len(changed))])
    if kind == 1:
        for _ in range(chance.randrange(1, 20)):
            changed[chance.randrange(len(changed))] = chance.randrange(256)
        return bytes(changed)
    lines = text.split(b"\n")
    at = chance.randrange(len(lines))
    if kind == 2:
        del lines[at : at + chance.randrange(1, 10)]
    elif kind == 3:
        lines.insert(at, lines[chance.randrange(len(lines))])
    elif kind == 4:
        other = chance.randrange(len(lines))
        lines[at], lines[other] = lines[other], lines[at]
    elif kind == 5:
        start = chance.randrange(len(changed))
        part = bytes(chance.randrange(256) for _ in range(chance.randrange(1, 200)))
        return bytes(changed[:start]) + part + bytes(changed[start:])
    else:
        for _ in range(chance.randrange(1, 4)):
            at = chance.randrange(len(lines))
            separator = chance.choice([b",", b" ", b".", b"="])
            fields = lines[at].split(separator)
            fields[chance.randrange(len(fields))] = chance.choice(_NUMBERS).encode()
            lines[at] = separator.join(fields)
    return b"\n".join(lines)
