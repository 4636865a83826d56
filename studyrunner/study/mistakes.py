"""What is wrong with the tables of a study: a sentence for each key that pydantic or a rule between keys refuses."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from studies.scene_error import SceneError, remedy_of
from studyrunner.user_error import UserError, Verbatim, WrongValueError
from studyrunner.values import Section, Wrong

Checked = TypeVar("Checked", bound=BaseModel)

_SINGLE = ("float_type", "int_type", "bool_type", "string_type")


class Mistakes:
    """Collects the mistakes of a study file, so that the user reads all of them at once. source: the file."""

    def __init__(self, source: str) -> None:
        self.source = source
        self._found: dict[str, UserError] = {}

    def __contains__(self, key: str) -> bool:
        return key in self._found

    def __len__(self) -> int:
        return len(self._found)

    def add(self, key: str, value: object, remedy: str) -> None:
        """One mistake; the first one counts of several under one key."""
        self._found.setdefault(key, UserError(self.source, key, value, remedy))

    @contextmanager
    def collecting(self, renamed: Mapping[str, str] | None = None) -> Iterator[None]:
        """The mistakes of a UserError that is raised inside. renamed: keys that the user gave at another place."""
        try:
            yield
        except UserError as error:
            for each in error.mistakes:
                key = (renamed or {}).get(each.key, each.key)
                self._found.setdefault(key, UserError(each.place, key, each.value, each.remedy))

    def raise_any(self, tables: Iterable[str] = ()) -> None:
        """Raises UserError with all mistakes, if there are any, by table in the order of the study file."""
        if self._found:
            order = {name: place for place, name in enumerate(tables)}
            names = sorted(self._found, key=lambda key: order.get(key.partition(".")[0], -1))
            first, *others = (self._found[name] for name in names)
            raise UserError(first.place, first.key, first.value, first.remedy, tuple(others))


@contextmanager
def scene_errors(source: str, path: Path | None) -> Iterator[None]:
    """SceneError and OSError become UserError. source: the study file. path: the scene file, None of bundled scenes."""
    place = source if path is None else str(path)
    try:
        yield
    except SceneError as error:
        table = "" if path is not None else "outputs." if error.key == "variables" else "scene."
        raise UserError(place, table + error.key, Verbatim(error.value), error.remedy) from None
    except OSError as error:
        raise UserError(place, "the scene file", None, f"give a file that can be read: {error.strerror}") from None


def check_table(
    kind: type[Checked],
    table: Mapping[str, object],
    source: str,
    prefix: str,
    others: Mapping[str, str] | None = None,
) -> Checked:
    """`kind` from the table, whose keys stand under `prefix`. others: keys that are looked at elsewhere, and their
    names there: a key itself where it stands in this table, "axes.step" in another one.

    Raises UserError with all that is wrong in the table.
    """
    found = Mistakes(source)
    wrong: Iterator[Wrong] = iter(())
    try:
        # tables of scenes are made for other callers as well, and take this from their caller
        checked = kind.model_validate(table, strict=None if issubclass(kind, Section) else True)
        wrong = checked.rules() if isinstance(checked, Section) else wrong
    except ValidationError as error:
        wrong = _wrong_keys(error, kind, table, others or {})
    for key, value, remedy in wrong:
        found.add(f"{prefix}.{key}" if key else prefix, value, remedy)
    found.raise_any()
    return checked


def _wrong_keys(
    error: ValidationError, kind: type[BaseModel], table: Mapping[str, object], others: Mapping[str, str]
) -> Iterator[Wrong]:
    """What is wrong in a table, once for each key; the keys are those below the table."""
    of_keys: dict[str, list[dict[str, Any]]] = {}
    for details in flat_errors(error):
        places = _places(table, details)
        details["names"] = [place for place in places if isinstance(place, str)]
        key = "".join(f"[{place}]" if isinstance(place, int) else f".{place}" for place in places)[1:]
        of_keys.setdefault(key, []).append(details)
    unknown = [found[0]["names"] for found in of_keys.values() if found[0]["type"] == "extra_forbidden"]
    meant = {".".join((*names[:-1], _nearest(kind, names, others))) for names in unknown}
    for key, found in of_keys.items():
        below = any(other.startswith((f"{key}.", f"{key}[")) for other in of_keys)
        if not below and not (found[0]["type"] == "missing" and key in meant):
            # of a key that takes several kinds of values, the kinds that fit as far as can be
            deepest = max(len(each["loc"]) for each in found)
            yield _wrong(kind, key, [each for each in found if len(each["loc"]) == deepest], others)


def _wrong(kind: type[BaseModel], key: str, found: Sequence[Mapping[str, Any]], others: Mapping[str, str]) -> Wrong:
    details, names = found[0], found[0]["names"]
    # a key without a description of its own is part of one with a description
    described = [_fields(kind, names[:depth]).get(each) for depth, each in enumerate(names)]
    description = next((field.description for field in reversed(described) if field and field.description), None)
    unit = f" ({re.sub(', [-1]$', '', description)})" if description else ""
    if details["type"] == "extra_forbidden":
        return Wrong(key, details["input"], f"unknown key, give {_nearest(kind, names, others)}")
    if details["type"] == "missing":
        if isinstance(details["loc"][-1], int):
            return Wrong(key, details["input"], f"give more values{unit}")
        return Wrong(key, None, f"missing: give it{unit}")
    cause = details.get("ctx", {}).get("error")
    if isinstance(cause, WrongValueError | SceneError):
        value = Verbatim(cause.value) if isinstance(cause, SceneError) else cause.value
        return Wrong(cause.key or key, value, cause.remedy + unit)
    may_be_axis = key in (kind.AXES if issubclass(kind, Section) else kind.model_fields)
    if isinstance(details["input"], list) and details["type"] in _SINGLE and may_be_axis:
        return Wrong(key, details["input"], f"give one value here, or the list as axes.{key}{unit}")
    remedies = dict.fromkeys(remedy_of(each).removeprefix("give ") for each in found)
    return Wrong(key, details["input"], f"give {', or '.join(remedies)}{unit}")


def flat_errors(error: ValidationError) -> Iterator[dict[str, Any]]:
    """All that is wrong, with its way from the table, also in tables that were checked on the way."""
    for details in error.errors(include_url=False):
        cause = details.get("ctx", {}).get("error")
        if isinstance(cause, ValidationError):
            yield from ({**each, "loc": (*details["loc"], *each["loc"])} for each in flat_errors(cause))
        else:
            yield {**details}


def _places(table: object, details: Mapping[str, Any]) -> list[str | int]:
    """Names and list places that lead to the error, without the kinds of value that were tried on the way.

    A place in a list is kept where a name follows.
    """
    places: list[str | int] = []
    inner: object = table
    for number, part in enumerate(details["loc"], 1):
        is_missing = number == len(details["loc"]) and details["type"] == "missing"
        if isinstance(inner, Mapping) and (part in inner or is_missing):
            places.append(part)
            inner = inner.get(part)
        elif isinstance(inner, list | tuple) and isinstance(part, int):
            places.append(part)
            inner = inner[part] if part < len(inner) else None
    while places and isinstance(places[-1], int):
        places.pop()
    return places


def _fields(kind: type[BaseModel], names: Sequence[str]) -> Mapping[str, FieldInfo]:
    """Keys of the table that `names` lead to, none where it is no table with keys of its own."""
    tables = [kind]
    for name in names:
        fields = [each.model_fields.get(name) for each in tables]
        extra = [each.EXTRA if issubclass(each, Section) else None for each in tables]
        inner = [one.annotation if one else other for one, other in zip(fields, extra, strict=True)]
        tables = [table for each in inner for table in tables_in(each)]
    return {name: field for each in tables for name, field in each.model_fields.items() if not field.exclude}


def tables_in(annotation: object) -> list[type[BaseModel]]:
    """All classes of tables that a type names."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [found for each in get_args(annotation) for found in tables_in(each)]


def _nearest(kind: type[BaseModel], names: Sequence[str], others: Mapping[str, str]) -> str:
    """What is meant by an unknown key, the last of the names; the others are those of the tables around it."""
    known = [*_fields(kind, names[:-1])]
    if len(names) > 1:
        return nearest_name(names[-1], known)
    known += [name for name, shown in others.items() if name == shown]
    elsewhere = close_name(names[-1], list(others)) if not close_name(names[-1], known) else ""
    return others.get(elsewhere) or nearest_name(names[-1], known)


def nearest_name(name: str, known: Iterable[str]) -> str:
    """The known name that is meant by `name`, or all of them: "one of a, b"."""
    names = list(dict.fromkeys(known))
    return close_name(name, names) or "one of " + ", ".join(names)


def close_name(name: str, known: Sequence[str]) -> str:
    """The known name that is meant by `name`; empty where none is."""
    # a longer name for the same, or a shorter one
    parts = [key for key in known if len(name) > 3 and (name.lower() in key or key in name.lower())]
    return next(iter(difflib.get_close_matches(name, known, n=1) or parts), "")
