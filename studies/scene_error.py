"""The error that a user can cause with a scene: wrong parameters or a wrong scene file."""

from collections.abc import Mapping
from typing import Any


class SceneError(ValueError):
    """A scene that cannot be built or read.

    key: what is wrong, as the user wrote it: a dotted parameter ("loss_factor") or a dataset ("contact/dofs").
    value: what was found there, in a few words.
    remedy: what would be right, one clause without a full stop.
    """

    def __init__(self, key: str, value: str, remedy: str) -> None:
        # All three go to `args`: an exception is pickled through them when it travels between ranks.
        super().__init__(key, value, remedy)
        self.key = key
        self.value = value
        self.remedy = remedy

    def __str__(self) -> str:
        return f"{self.key}: {self.value}; {self.remedy}."


_KINDS = {
    **dict.fromkeys(("model_type", "model_attributes_type", "dict_type"), "give a table"),
    **dict.fromkeys(("tuple_type", "list_type"), "give a list"),
    "string_type": "give a text in quotes",
    "float_type": "give a number",
    **dict.fromkeys(("int_type", "int_from_float"), "give a whole number"),
    "bool_type": "give true or false",
    "finite_number": "give a finite number",
    "too_long": "give fewer values",
    "too_short": "give more values",
    "greater_than": "give a number above {gt:g}",
    "greater_than_equal": "give a number that is {ge:g} or more",
    "less_than": "give a number below {lt:g}",
    "less_than_equal": "give a number that is {le:g} or less",
}


def remedy_of(error: Mapping[str, Any]) -> str:
    """What would be right in place of a value that pydantic refuses, from one of the `errors()` of its exception."""
    if error["type"] in _KINDS:
        return _KINDS[error["type"]].format(**error.get("ctx", {}))
    return str(error["msg"]).removeprefix("Value error, ").replace("Input should be", "give").replace("'", '"').strip()
