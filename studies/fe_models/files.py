"""Files of other programs: those of a model, its units, numbers in them, and what is wrong in them, in one sentence."""

import contextlib
import hashlib
import io
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studies.scene_error import SceneError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

LARGEST_NUMBER = 2**31 - 1
"""Of a node or an element: the codes count in 32 bits."""

LARGEST_FILE = 2**32
"""Bytes of a file, beside decks."""

_LONGEST_REASON = 160
_INTEGER = re.compile(r"[+-]?\d{1,18}")
_REAL = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+))(?:[eEdD]?([+-]\d{1,4})|[eEdD](\d{1,4}))?")


@dataclass(frozen=True)
class ModelFiles:
    """Files of a model.

    mesh: the deck, mesh or table of nodes. matrices: the files with the matrices, none where they are assembled here.
    recovery: the table of further responses; None of none.
    """

    mesh: Path
    matrices: tuple[Path, ...] = ()
    recovery: Path | None = None

    @property
    def all(self) -> tuple[Path, ...]:
        """All of them but what the deck includes."""
        return (self.mesh, *self.matrices, *((self.recovery,) if self.recovery is not None else ()))


def file_digest(path: Path) -> str:
    """SHA-256 of a file, hexadecimal. Raises OSError."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


@dataclass(frozen=True)
class Units:
    """A system of units with the second, its units in those of SI: m, kg, N/m, N, kg/m3, Pa.

    label_of_length, label_of_mass: for messages.
    """

    name: str
    label_of_length: str
    label_of_mass: str
    length: float
    mass: float
    stiffness: float
    force: float
    density: float
    stress: float


UNITS = {
    name: Units(name, *labels, length, mass, mass, mass * length, mass / length**3, mass / length)
    for name, labels, length, mass in (("SI", ("m", "kg"), 1.0, 1.0), ("mm-t-s", ("mm", "t"), 1e-3, 1e3))
}
"""Systems of units by their names."""


def shown(text: str) -> str:
    """A text out of a file as it may stand in a message: at most 40 characters, all of them printable."""
    clean = _printable(text.strip())
    return clean if len(clean) <= 40 else f"{clean[:37]}..."


def _printable(text: str) -> str:
    return "".join(letter if letter.isprintable() else "?" for letter in text)


def check_there(path: Path, key: str = "model") -> None:
    """Raises SceneError, about `key`, where there is no such file that can be read."""
    try:
        if there := path.is_file():
            path.open("rb").close()
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or "no name of a file"
        raise SceneError(key, f"{shown(path.name)}: {why}", "give a file that can be read") from None
    if not there:
        raise SceneError(key, f"there is no file {shown(path.name)}", "give a path relative to the study file")


def check_file(path: Path, largest: int = LARGEST_FILE, key: str = "matrices") -> None:
    """The same where a file is empty, or larger than `largest` bytes."""
    check_there(path, key)
    size = path.stat().st_size
    if not 0 < size <= largest:
        raise SceneError(key, f"{shown(path.name)} has {size} bytes", f"write it again, with at most {largest}")


@dataclass(frozen=True)
class Place:
    """A line of a file, counted from 1; as a text "sector.inp, line 12: *NODE". keyword: of this line or above it."""

    file: str
    line: int
    keyword: str = ""

    def __str__(self) -> str:
        return f"{self.file}, line {self.line}" + (f": *{self.keyword}" if self.keyword else "")

    def wrong(self, found: str, remedy: str) -> SceneError:
        """The error about this place: what stands there, and what would be right (a clause without a full stop)."""
        return SceneError("model", f"{self}: {found}", remedy)


@contextlib.contextmanager
def library_errors(path: Path, library: str, package: str, key: str) -> Iterator[None]:
    """A block that loads a library and has it read a file; what the library prints is not shown.

    library, package: the module, and the package that brings it. key: what errors are about. Raises SceneError.
    """
    check_file(path, key=key)
    said = io.StringIO()
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
            yield
    except SceneError:
        raise
    except ImportError as error:
        found = f"{path.name} needs the library {library}, which does not load ({error})"
        raise SceneError(key, found, f"install the library: pip install {package}") from None
    # the libraries raise anything for a file that they do not understand
    except Exception as error:
        # errors of Python itself say nothing about the file
        known = type(error).__module__ != "builtins"
        clean = _printable(" ".join(str(error).split()))
        why = f" ({clean[:_LONGEST_REASON]})" if clean and known else ""
        found = f"{path.name} is damaged, or of a kind that {library} does not know{why}"
        raise SceneError(key, found, "write it again") from error


def is_integer(text: str) -> bool:
    """Whether a text is a whole number."""
    return _INTEGER.fullmatch(text) is not None


def to_float(text: str) -> float:
    """A number, Fortran's 1.5D+03 and 1.5+3 included; NaN for any other text, infinity included."""
    match = _REAL.fullmatch(text)
    value = math.nan if match is None else float(f"{match[1]}e{match[2] or match[3] or 0}")
    return value if math.isfinite(value) else math.nan


def read_float(text: str, place: Place) -> float:
    """A finite number; 0 for an empty text. Raises SceneError."""
    value = to_float(text.strip() or "0")
    if math.isnan(value):
        raise place.wrong(f"{shown(text)!r} in place of a number", "give a finite number")
    return value


def read_integer(text: str, place: Place, what: str = "a whole number") -> int:
    """A whole number from 1 to LARGEST_NUMBER. Raises SceneError, about `what`."""
    text = text.strip()
    if not is_integer(text) or not 0 < int(text) <= LARGEST_NUMBER:
        raise place.wrong(f"{shown(text)!r} in place of {what}", f"give a whole number of at most {LARGEST_NUMBER}")
    return int(text)
