"""A table of the study file as a pydantic model, or a sentence on the first value that is wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeVar, get_args

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from studies.scene_error import SceneError, remedy_of
from studyrunner.study.similar_names import nearest_name
from studyrunner.user_error import UserError, Verbatim, WrongValueError

Checked = TypeVar("Checked", bound=BaseModel)

_SINGLE = ("float_type", "int_type", "bool_type", "string_type")
_NO_UNITS = (", -", ", 1")


def check_table(kind: type[Checked], table: Mapping[str, object], source: str, prefix: str) -> Checked:
    """`kind` from the table, or UserError for the first thing wrong in it. Keys of the table stand under `prefix`."""
    try:
        return kind.model_validate(table, strict=True)
    except ValidationError as error:
        errors = error.errors(include_url=False)
    except SceneError as error:
        raise UserError(
            source, ".".join(filter(None, (prefix, error.key))), Verbatim(error.value), error.remedy
        ) from None
    # of a key that takes several kinds of values, the kind that fits as far as can be
    same_key = [each for each in errors if each["loc"][:1] == errors[0]["loc"][:1]]
    details = max(same_key, key=lambda each: len(each["loc"]))
    raise _user_error(kind, table, details, source, prefix)


def _user_error(
    kind: type[BaseModel], table: Mapping[str, object], details: ErrorDetails, source: str, prefix: str
) -> UserError:
    places = _places(table, details)
    key = prefix
    for place in places:
        key += f"[{place}]" if isinstance(place, int) else f"{'.' if key else ''}{place}"
    names = [place for place in places if isinstance(place, str)]
    fields = _fields(kind, names[:-1])
    field = names[-1] if names else ""
    description = fields[field].description if field in fields else None
    unit = f" ({_without_unit_one(description)})" if description else ""
    if details["type"] == "extra_forbidden":
        return UserError(source, key, details["input"], f"unknown key, give {nearest_name(field, fields)}")
    if details["type"] == "missing":
        if isinstance(details["loc"][-1], int):
            return UserError(source, key, details["input"], f"give more values{unit}")
        return UserError(source, key, None, f"missing: give it{unit}")
    cause = details.get("ctx", {}).get("error")
    if isinstance(cause, WrongValueError):
        return UserError(source, cause.key or key, cause.value, cause.remedy + unit)
    if isinstance(cause, SceneError):
        named = ".".join(filter(None, (prefix, cause.key)))
        return UserError(source, named or key, Verbatim(cause.value), cause.remedy + unit)
    if isinstance(details["input"], list) and details["type"] in _SINGLE and prefix != "axes":
        names_of_axis = key.partition(".")[2]
        several = f"give one value here, or the list as axes.{names_of_axis}"
        return UserError(source, key, details["input"], several + unit)
    return UserError(source, key, details["input"], remedy_of(details) + unit)


def _places(table: object, details: ErrorDetails) -> list[str | int]:
    """Names and list places that lead to the error, without the kinds of value that were tried on the way.

    A place in a list is kept where a name follows.
    """
    places: list[str | int] = []
    inner: object = table
    for part in details["loc"]:
        last = part == details["loc"][-1]
        if isinstance(inner, Mapping) and (part in inner or (last and details["type"] == "missing")):
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
        found = [each.model_fields[name].annotation for each in tables if name in each.model_fields]
        tables = [inner for each in found for inner in _tables(each)] or tables[:0]
    return {name: field for each in tables for name, field in each.model_fields.items()}


def _tables(annotation: object) -> list[type[BaseModel]]:
    """All classes of tables that a type names."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [found for each in get_args(annotation) for found in _tables(each)]


def _without_unit_one(description: str) -> str:
    for unit in _NO_UNITS:
        description = description.removesuffix(unit)
    return description
