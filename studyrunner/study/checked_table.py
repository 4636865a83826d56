"""A table of the study file as a pydantic model, or a sentence on the first value that is wrong."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeVar

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from studies.scene_error import SceneError
from studyrunner.study.similar_names import nearest_name
from studyrunner.user_error import UserError, Verbatim, WrongValueError

Checked = TypeVar("Checked", bound=BaseModel)

_SINGLE = ("float_type", "int_type", "bool_type", "string_type")


def check_table(kind: type[Checked], table: Mapping[str, object], source: str, prefix: str) -> Checked:
    """`kind` from the table, or UserError for the first thing wrong in it. Keys of the table stand under `prefix`."""
    try:
        return kind.model_validate(table, strict=True)
    except ValidationError as error:
        details = error.errors(include_url=False)[0]
    except SceneError as error:
        raise UserError(
            source, ".".join(filter(None, (prefix, error.key))), Verbatim(error.value), error.remedy
        ) from None
    raise _user_error(kind, details, source, prefix)


def _user_error(kind: type[BaseModel], details: ErrorDetails, source: str, prefix: str) -> UserError:
    owner, names = _owner(kind, [str(part) for part in details["loc"]])
    key, field = ".".join(filter(None, (prefix, *names))), names[-1] if names else ""
    description = owner.model_fields[field].description if field in owner.model_fields else None
    unit = f" ({description})" if description else ""
    if details["type"] == "extra_forbidden":
        return UserError(source, key, details["input"], f"unknown key, give {nearest_name(field, owner.model_fields)}")
    if details["type"] == "missing":
        return UserError(source, key, None, f"missing: give it{unit}")
    cause = details.get("ctx", {}).get("error")
    if isinstance(cause, WrongValueError):
        return UserError(source, cause.key or key, cause.value, cause.remedy + unit)
    if isinstance(cause, SceneError):
        named = ".".join(filter(None, (prefix, cause.key)))
        return UserError(source, named or key, Verbatim(cause.value), cause.remedy + unit)
    if isinstance(details["input"], list) and details["type"] in _SINGLE and prefix != "axes":
        names = key.partition(".")[2]
        several = f"give one value here, or the list as axes.{names}"
        return UserError(source, key, details["input"], several + unit)
    message = details["msg"].removeprefix("Value error, ").replace("Input should be", "give").strip()
    return UserError(source, key, details["input"], message + unit)


def _owner(kind: type[BaseModel], place: Sequence[str]) -> tuple[type[BaseModel], Sequence[str]]:
    """Class that holds the key at `place`, and the names that lead to it, without places in a list."""
    for depth, name in enumerate(place, start=1):
        inner = kind.model_fields[name].annotation if name in kind.model_fields else None
        if depth == len(place) or not (isinstance(inner, type) and issubclass(inner, BaseModel)):
            return kind, place[:depth]
        kind = inner
    return kind, ()
