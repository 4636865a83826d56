"""What is wrong with the tables of a study: one sentence for each key that pydantic or a rule between keys refuses."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from studies.scene_error import SceneError, remedy_of
from studyrunner.user_error import UserError, Verbatim, WrongValueError
from studyrunner.values import Section, Wrong

Details = dict[str, Any]
"""One of the `errors()` of pydantic; "names": the keys that lead to it."""

_SINGLE = ("float_type", "int_type", "bool_type", "string_type")


def raise_wrong(source: str, wrong: Iterable[Wrong]) -> None:
    """Raises UserError with all that is wrong, if anything is; the first counts of several under one key."""
    _raise_all([UserError(source, *each) for each in wrong])


def _raise_all(mistakes: Iterable[UserError]) -> None:
    found: dict[str, UserError] = {}
    for each in mistakes:
        found.setdefault(each.key, each)
    if found:
        first, *others = found.values()
        raise UserError(first.place, first.key, first.value, first.remedy, tuple(others))


@contextmanager
def keys_as_given(renamed: Mapping[str, str]) -> Iterator[None]:
    """A UserError that is raised inside names keys as the user gave them. renamed: names of keys, or of their tables,
    in the study and in its file.
    """
    try:
        yield
    except UserError as error:
        mistakes = []
        for each in error.mistakes:
            whole = f"{each.key}."
            names = (new + whole[len(old) : -1] for old, new in renamed.items() if whole.startswith(f"{old}."))
            mistakes.append(UserError(each.place, next(names, each.key), each.value, each.remedy))
        _raise_all(mistakes)


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


def check_tables(
    kinds: Mapping[str, type[BaseModel]],
    tables: Mapping[str, Any],
    source: str,
    also: Mapping[str, Iterable[str]] | None = None,
) -> dict[str, Any]:
    """An object of its class for each table, from what the study file gives; a missing table has its defaults.

    kinds: classes by the names of tables, which may be dotted. also: further keys by table, which are looked at
    elsewhere. Raises UserError with all that is wrong.
    """
    checked, also, wrong = {}, also or {}, list[Wrong]()
    elsewhere = {key: f"{name}.{key}" for name, kind in reversed([*kinds.items()]) for key in kind.model_fields}
    for name, kind in kinds.items():
        table = tables.get(name, {})
        try:
            # tables of scenes are made for other callers as well, and take this from their caller
            checked[name] = kind.model_validate(table, strict=None if issubclass(kind, Section) else True)
        except ValidationError as error:
            others = {**elsewhere, **{key: key for key in also.get(name, ())}}
            for each in _wrong_keys(error, kind, table, others):
                wrong.append(each._replace(key=f"{name}.{each.key}" if each.key else name))
    raise_wrong(source, wrong)
    return checked


def _wrong_keys(
    error: ValidationError, kind: type[BaseModel], table: object, others: Mapping[str, str]
) -> Iterator[Wrong]:
    """What is wrong in a table, once for each key. others: keys beside those of the table, and where they stand."""
    of_keys: dict[str, list[Details]] = {}
    for details in _flat_errors(error):
        details["names"] = _names(table, details)
        of_keys.setdefault(".".join(details["names"]), []).append(details)
    for key, found in of_keys.items():
        if not any(other.startswith(f"{key}.") for other in of_keys):
            # of a key that takes several kinds of values, the kinds that fit as far as can be
            deepest = max(len(each["loc"]) for each in found)
            yield _wrong(kind, key, [each for each in found if len(each["loc"]) == deepest], others)


def _wrong(kind: type[BaseModel], key: str, found: Sequence[Details], others: Mapping[str, str]) -> Wrong:
    details, names = found[0], found[0]["names"]
    # a key without a description of its own is part of one with a description
    fields = [_fields(kind, names[:depth]).get(each) for depth, each in enumerate(names)]
    description = next((field.description for field in reversed(fields) if field and field.description), None)
    unit = f" ({re.sub(', [-1]$', '', description)})" if description else ""
    if details["type"] == "extra_forbidden":
        return Wrong(key, details["input"], f"unknown key, give {_meant(kind, names, others)}")
    if details["type"] == "missing":
        if isinstance(details["loc"][-1], int):
            return Wrong(key, details["input"], f"give more values{unit}")
        return Wrong(key, None, f"missing: give it{unit}")
    cause = details.get("ctx", {}).get("error")
    if isinstance(cause, SceneError):
        return Wrong(cause.key or key, Verbatim(cause.value), cause.remedy + unit)
    if isinstance(cause, WrongValueError):
        return Wrong(".".join(filter(None, (key, cause.key))), cause.value, cause.remedy + unit)
    may_be_axis = key in (kind.AXES if issubclass(kind, Section) else kind.model_fields)
    if isinstance(details["input"], list) and details["type"] in _SINGLE and may_be_axis:
        return Wrong(key, details["input"], f"give one value here, or the list as axes.{key}{unit}")
    remedies = dict.fromkeys(remedy_of(each).removeprefix("give ") for each in found)
    return Wrong(key, details["input"], f"give {', or '.join(remedies)}{unit}")


def _flat_errors(error: ValidationError) -> Iterator[Details]:
    """All that is wrong, with its way from the table, also in tables that were checked on the way."""
    for details in error.errors(include_url=False):
        cause = details.get("ctx", {}).get("error")
        if isinstance(cause, ValidationError):
            yield from ({**each, "loc": (*details["loc"], *each["loc"])} for each in _flat_errors(cause))
        else:
            yield {**details}


def _names(table: object, details: Details) -> list[str]:
    """Keys that lead to the error, without places in lists and the kinds of value that were tried on the way."""
    names: list[str] = []
    inner: object = table
    for number, part in enumerate(details["loc"], 1):
        is_missing = number == len(details["loc"]) and details["type"] == "missing"
        if isinstance(inner, Mapping) and (part in inner or is_missing):
            names.append(str(part))
            inner = inner.get(part)
        elif isinstance(inner, list | tuple) and isinstance(part, int) and part < len(inner):
            inner = inner[part]
    return names


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


def _meant(kind: type[BaseModel], names: Sequence[str], others: Mapping[str, str]) -> str:
    """What is meant by an unknown key, the last of the names: a key of its table, or of another one."""
    known = [*_fields(kind, names[:-1])]
    if len(names) == 1:
        known += [name for name, shown in others.items() if name == shown]
        if not close_name(names[0], known) and (elsewhere := close_name(names[0], list(others))):
            return others[elsewhere]
    return nearest_name(names[-1], known)


def nearest_name(name: str, known: Iterable[str]) -> str:
    """The known name that is meant by `name`, or all of them: "one of a, b"."""
    names = list(dict.fromkeys(known))
    return close_name(name, names) or "one of " + ", ".join(names)


def close_name(name: str, known: Sequence[str]) -> str:
    """The known name that is meant by `name`; empty where none is."""
    # a longer name for the same, or a shorter one
    parts = [key for key in known if len(name) > 3 and (name.lower() in key or key in name.lower())]
    return next(iter(difflib.get_close_matches(name, known, n=1) or parts), "")
