"""Reads a deck of CalculiX or Abaqus.

A deck is read twice: first the keywords of the mesh, whose sets and surfaces may be named before they are defined;
then, with the mesh at hand, all others in the order of the file.
"""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from studies.fe_models.deck import model_keywords, step_keywords
from studies.fe_models.deck.contents import Deck
from studies.fe_models.deck.keywords import HARMLESS, KEYWORDS, Block, find_keyword
from studies.fe_models.deck.mesh import Draft, Mesh
from studies.fe_models.deck.mesh_keywords import read_mesh_keyword
from studies.fe_models.deck.model import Model
from studies.fe_models.files import Place, check_file, shown

# the table is complete once all its readers are loaded
__all__ = ["HARMLESS", "KEYWORDS", "model_keywords", "read_deck", "step_keywords"]

_LARGEST_DECK = 2**28  # bytes of a file: a mesh of about two million nodes
_BYTE_ORDER_MARK = "\xef\xbb\xbf"  # of UTF-8, which some editors write, in Latin-1
_WITH_INPUT = ("NODE", "ELEMENT", "NSET", "ELSET")
# the name of a parameter, and its value: quoted, or up to the next comma
_PARAMETER = re.compile(r'[\s,]*([^,="]+?)\s*(?:=\s*("[^"]*"|[^,"]*))?\s*(?:,|$)')
_LOADS = ("CLOAD", "DSLOAD", "TEMPERATURE")  # of steps that are not static they do not matter


def read_deck(path: Path) -> Deck:
    """The model of a deck of CalculiX or Abaqus, in units of the file, with the files that it includes.

    Numbers of the first instance are those of its part; of the others they are larger, as a note says. Raises
    SceneError about "model" where the deck makes no sense, or has what may change the model and is not read.
    """
    draft, block = Draft(path.name), None
    for begun in _read_keywords(path, path.name, path.parent.resolve(), draft.included, (), []):
        if block is not None:
            read_mesh_keyword(draft, block)
        block = begun
    if block is None:
        raise Place(path.name, 1).wrong("no keyword in the file", "give a deck of CalculiX or Abaqus")
    read_mesh_keyword(draft, block)
    if draft.part or draft.scope:
        raise block.place.wrong(f"the end of {draft.part or draft.scope} is missing", "write *END PART, *END INSTANCE")
    model = Model(Mesh(draft))
    for block in draft.others:
        unused = model.step is not None and not model.step.loads_count
        if block.keyword in HARMLESS or (unused and block.keyword in _LOADS):
            model.skipped.append(str(block.place))
        else:
            find_keyword(block, any_parameters=unused and block.keyword == "DLOAD").reader(model, block)
    model.end_step()
    return model.deck()


def _read_keywords(
    path: Path, name: str, folder: Path, included: list[str], within: tuple[Path, ...], last: list[Block]
) -> Iterator[Block]:
    """The keywords of a file and of files that it includes, in the deck's folder or below, each as it begins.

    Data lines go to the last keyword, which is whole when another one begins, also in an included file and behind it.
    included: takes names of files. within: files that are open.
    """
    check_file(path, _LARGEST_DECK, "model")
    within = (*within, path.resolve())
    with path.open(encoding="latin-1") as file:
        for text, number in _joined(file):
            if not text.startswith("*"):
                if not last:
                    what = f"{shown(text)!r} before the first keyword"
                    raise Place(name, number).wrong(what, "give a deck of CalculiX or Abaqus as plain text")
                last[-1].lines.append(text)
                last[-1].places.append((name, number))
                continue
            block = _cut_keyword(text, Place(name, number))
            if block.keyword != "INCLUDE":
                last[:] = [block]
                yield block
                if block.keyword not in _WITH_INPUT or "INPUT" not in block.parameters:
                    continue
            inner = _find_included(block, folder)
            if inner in within:
                raise block.place.wrong(f"{shown(inner.name)} includes itself", "remove this line")
            relative = str(inner.relative_to(folder))
            if relative not in included:
                included.append(relative)
            yield from _read_keywords(inner, relative, folder, included, within, last)


def _joined(lines: Iterable[str]) -> Iterator[tuple[str, int]]:
    """Keywords, each as one line, and data lines, with their numbers; without comments and empty lines."""
    begun: tuple[str, int] | None = None  # a keyword that goes on in the next line
    for number, raw in enumerate(lines, 1):
        text = raw.removeprefix(_BYTE_ORDER_MARK).strip() if number == 1 else raw.strip()
        if not text or text == "*" or text.startswith("**"):
            continue
        line = text, number
        if begun is not None and text.startswith("*"):
            yield begun
        elif begun is not None:
            line = begun[0] + text, begun[1]
        begun = line if line[0].startswith("*") and text.endswith(",") else None
        if begun is None:
            yield line
    if begun is not None:
        yield begun


def _find_included(block: Block, folder: Path) -> Path:
    """The file that a keyword names. Raises SceneError where it is missing, or outside of the folder."""
    name = block.parameters.get("INPUT", "").strip().strip('"')
    try:
        path = (folder / name).resolve()
        missing = not path.is_file()
    except (OSError, ValueError):
        missing, path = True, folder
    if not path.is_relative_to(folder):
        raise block.place.wrong(f"{shown(name)} is outside the deck's folder", "copy it beside the deck")
    if missing:
        raise block.place.wrong(f"there is no file {shown(name)}", "copy it beside the deck")
    return path


def _cut_keyword(text: str, place: Place) -> Block:
    written, _, rest = text[1:].partition(",")
    if not (keyword := "".join(written.split()).upper()):
        raise place.wrong("a star without a keyword", "write **, where it begins a comment")
    place = Place(place.file, place.line, shown(" ".join(written.split()).upper()))
    parameters: dict[str, str] = {}
    at, rest = 0, rest.rstrip().rstrip(",")
    while at < len(rest):
        match = _PARAMETER.match(rest, at)
        if match is None or match.end() == at:
            raise place.wrong(f"{shown(rest[at:])!r} is no parameter", "write NAME=value")
        parameters["".join(match[1].split()).upper()] = (match[2] or "").strip()
        at = match.end()
    return Block(keyword, parameters, place)
