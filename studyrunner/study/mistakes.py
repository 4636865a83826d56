"""What is wrong with the tables of a study: one sentence for each key that pydantic or a rule between keys refuses."""

import difflib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from studies.scene import describe_field
from studies.scene_error import SceneError, remedy_of
from studyrunner.user_error import UserError, Verbatim
from studyrunner.values import Section, Wrong

_NUMBERS = ("float_type", "int_type", "value_error")
_SIZES = {
    1.0: "m m3 N Pa 1/Pa Hz s kg rpm",
    1e-2: "cm %",
    1e-3: "mm mN",
    1e-6: "um mm2 1/MPa mm2/N",
    1e-9: "nm mm3 mm3/J mm3/Nm mm3/(Nm)",
    1e-18: "um3",
    1e3: "kN kPa kHz N/mm t",
    1e6: "MPa",
    1e9: "GPa",
    60.0: "min",
    3600.0: "h",
}
_UNITS = {unit: size for size, units in _SIZES.items() for unit in units.split()}
"""Of units that are written behind a number, their size in the unit of the key."""
_SINGLE = ("float_type", "int_type", "bool_type", "string_type")


def raise_wrong(source: str, wrong: Iterable[Wrong]) -> None:
    """Raises UserError with all that is wrong, if anything is; the first counts of several under one key."""
    _raise_all([UserError(source, each.key, each.value, each.remedy) for each in wrong])


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


def check_tables(kinds: Mapping[str, type[BaseModel]], tables: Mapping[str, Any], source: str) -> dict[str, Any]:
    """An object of its class for each table, from what the study file gives; a missing table has its defaults.

    kinds: classes by the names of tables, which may be dotted. Raises UserError with all that is wrong.
    """
    checked, wrong = {}, list[Wrong]()
    elsewhere = {key: f"{name}.{key}" for name, kind in reversed([*kinds.items()]) for key in kind.model_fields}
    for name, kind in kinds.items():
        table = tables.get(name, {})
        try:
            # tables of scenes are made for other callers as well, and take this from their caller
            checked[name] = kind.model_validate(table, strict=None if issubclass(kind, Section) else True)
        except ValidationError as error:
            found = _wrong_keys(error, kind, table, elsewhere)
            wrong += (Wrong(f"{name}.{each.key}".removesuffix("."), each.value, each.remedy) for each in found)
    raise_wrong(source, wrong)
    return checked


@dataclass(frozen=True)
class _Mistake:
    """One of the `errors()` of pydantic. names: keys that lead there. tables: classes of the table with the last one.

    meaning: of this key, as it stands behind a remedy.
    """

    details: dict[str, Any]
    names: tuple[str, ...]
    tables: list[type[BaseModel]]
    meaning: str


def _wrong_keys(
    error: ValidationError, kind: type[BaseModel], table: object, elsewhere: Mapping[str, str]
) -> Iterator[Wrong]:
    """What is wrong in a table, once for each key. elsewhere: keys of all tables, and where they stand."""
    of_keys: dict[str, list[_Mistake]] = {}
    for details in _flat_errors(error):
        mistake = _locate(details, kind, table)
        of_keys.setdefault(".".join(mistake.names), []).append(mistake)
    for key, found in of_keys.items():
        if not any(other.startswith(f"{key}.") for other in of_keys):
            # of a key that takes several kinds of values, the kinds that fit as far as can be
            deepest = max(len(each.details["loc"]) for each in found)
            yield _wrong(key, [each for each in found if len(each.details["loc"]) == deepest], elsewhere)


def _flat_errors(error: ValidationError) -> Iterator[dict[str, Any]]:
    """All that is wrong, with its way from the table, also in tables that were checked on the way."""
    for details in error.errors(include_url=False):
        cause = details.get("ctx", {}).get("error")
        if isinstance(cause, ValidationError):
            yield from ({**each, "loc": (*details["loc"], *each["loc"])} for each in _flat_errors(cause))
        else:
            yield {**details}


def _locate(details: dict[str, Any], kind: type[BaseModel], table: object) -> _Mistake:
    """Where an error is, without places in lists and the kinds of value that were tried on the way."""
    names, around, meaning = list[str](), [kind], ""
    inner, tables = table, [kind]
    for number, part in enumerate(details["loc"], 1):
        is_missing = number == len(details["loc"]) and details["type"] == "missing"
        if isinstance(inner, Mapping) and (part in inner or is_missing):
            names, around, inner = [*names, str(part)], tables, inner.get(part)
            fields = [each.model_fields[part] for each in tables if part in each.model_fields]
            extra = [each.EXTRA for each in tables if issubclass(each, Section) and each.EXTRA and not fields]
            tables = [found for field in fields for found in tables_in(field.annotation)] + [each for each, _ in extra]
            # a key without a description of its own is part of one with a description
            meanings = (*map(describe_field, fields), *(f"as {looks}" for _, looks in extra))
            meaning = next(filter(None, meanings), meaning)
        elif isinstance(inner, list | tuple) and isinstance(part, int) and part < len(inner):
            inner = inner[part]
    return _Mistake(details, tuple(names), around, f" ({meaning})" if meaning else "")


def _wrong(key: str, found: Sequence[_Mistake], elsewhere: Mapping[str, str]) -> Wrong:
    details, tables, meaning = found[0].details, found[0].tables, found[0].meaning
    kind, value, cause = details["type"], details["input"], details.get("ctx", {}).get("error")
    if kind == "extra_forbidden":
        known = [name for each in tables for name, field in each.model_fields.items() if not field.exclude]
        *above, name = found[0].names
        other = "" if above or close_name(name, known) else close_name(name, list(elsewhere))
        return Wrong(key, value, f"unknown key, give {elsewhere.get(other) or nearest_name(name, known)}")
    if kind == "missing":
        is_value = isinstance(details["loc"][-1], int)
        remedy = "give more values" if is_value else "missing: give it"
        return Wrong(key, value if is_value else None, remedy + meaning)
    if isinstance(cause, SceneError):
        return Wrong(cause.key or key, Verbatim(cause.value), cause.remedy + meaning)
    if isinstance(cause, Wrong):
        return Wrong(".".join(filter(None, (key, cause.key))), cause.value, cause.remedy + meaning)
    own_axes = [name for each in tables for name in getattr(each, "AXES", each.model_fields)]
    if isinstance(value, list) and kind in _SINGLE and key in own_axes:
        return Wrong(key, value, f"give one value here, or the list as axes.{key}{meaning}")
    if isinstance(value, str) and (number := _in_si(value)) and kind in _NUMBERS:
        return Wrong(key, value, f"give {number}, the number in SI without a unit{meaning}")
    remedies = dict.fromkeys(remedy_of(each.details).removeprefix("give ") for each in found)
    return Wrong(key, value, f"give {', or '.join(remedies)}{meaning}")


def _in_si(text: str) -> str:
    """A number with a unit, as "5 um", as the number in SI; "" for any other text."""
    found = re.fullmatch(r"\s*([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*(.+)", text)
    unit = found[2].replace(" ", "") if found else ""
    for micro in "\N{GREEK SMALL LETTER MU}\N{MICRO SIGN}":
        unit = unit.replace(micro, "u")
    try:
        return f"{float(found[1]) * _UNITS[unit]:.12g}" if found else ""
    except (ValueError, KeyError):
        return ""


def tables_in(annotation: object) -> list[type[BaseModel]]:
    """All classes of tables that a type names."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [found for each in get_args(annotation) for found in tables_in(each)]


def nearest_name(name: str, known: Iterable[str]) -> str:
    """The known name that is meant by `name`, or all of them: "one of a, b"."""
    names = list(dict.fromkeys(known))
    return close_name(name, names) or "one of " + ", ".join(names)


def close_name(name: str, known: Sequence[str]) -> str:
    """The known name that is meant by `name`; empty where none is."""
    own = name.lower()
    # the end of a longer name, as "amplitude" of excitation_amplitude, or a part of it, or a shorter name
    ends = [key for key in known if len(own) > 3 and key.endswith(f"_{own}")]
    parts = [key for key in known if len(own) > 3 and (own in key or key in own)]
    return next(iter(ends or difflib.get_close_matches(name, known, n=1) or parts), "")
