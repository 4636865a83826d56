"""Values of the solver as text and plain arrays, to be kept on disk: the state of a march or of a sweep.

`unpack(pack(value))` is equal to `value` to the last bit, and its arrays lie in memory in rows. The order in which an
array lies decides the order of sums over it, and so their last bits: a computation that is to go on elsewhere to the
same numbers goes on from the unpacked value itself.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from solver.outcome import Outcome

T = TypeVar("T")

_CLASSES: dict[str, type[Any]] = {}


@dataclass(frozen=True)
class Packed:
    """A value as JSON text that refers to arrays by their place."""

    text: str
    arrays: tuple[NDArray[np.generic], ...]

    @property
    def n_bytes(self) -> int:
        """Size in a file."""
        return len(self.text) + sum(array.nbytes for array in self.arrays)


def packable(known: type[T]) -> type[T]:
    """Decorator of the frozen classes that are part of the state of a march or of a sweep; no two of one name."""
    assert known.__name__ not in _CLASSES
    _CLASSES[known.__name__] = known
    return known


def pack(value: object) -> Packed:
    """Text and arrays of a value.

    Parameters
    ----------
    value
        Numbers, texts, None, arrays, tuples, lists, dicts with text keys, outcomes and packable classes.

    Raises
    ------
    TypeError
        For anything else: a bug.
    """
    arrays: list[NDArray[np.generic]] = []
    text = json.dumps(_described(value, arrays))
    return Packed(text, tuple(arrays))


def unpack(packed: Packed) -> Any:
    """The value.

    Raises
    ------
    ValueError, KeyError, TypeError, IndexError
        Where text and arrays are not those of a value.
    """
    return _rebuilt(json.loads(packed.text), packed.arrays)


def attributes(part: object, state: type[T]) -> T:
    """The attributes of a part that a TypedDict of states names."""
    return cast("T", {name: getattr(part, name) for name in state.__annotations__})


def set_attributes(part: object, state: Mapping[str, object]) -> None:
    """Set the attributes that a state holds."""
    for name, value in state.items():
        setattr(part, name, value)


def _described(value: object, arrays: list[NDArray[np.generic]]) -> object:
    """JSON of a value; its arrays are appended to `arrays`."""
    if isinstance(value, Outcome):
        return {"outcome": int(value)}
    # np.float64 is a float; as a plain one it would divide by zero differently
    if value is None or (isinstance(value, bool | int | float | str) and not isinstance(value, np.generic)):
        return value
    if isinstance(value, np.ndarray | np.generic):
        arrays.append(np.array(value, order="C"))
        return {"scalar" if isinstance(value, np.generic) else "array": len(arrays) - 1}
    if isinstance(value, tuple | list):
        kind = "tuple" if isinstance(value, tuple) else "list"
        return {kind: [_described(item, arrays) for item in value]}
    if isinstance(value, dict):
        return {"dict": {key: _described(item, arrays) for key, item in value.items()}}
    name = type(value).__name__
    if is_dataclass(value) and _CLASSES.get(name) is type(value):
        items = {field.name: _described(getattr(value, field.name), arrays) for field in fields(value)}
        return {"class": name, "fields": items}
    raise TypeError(f"{name} is not a value that can be packed")


def _rebuilt(node: Any, arrays: tuple[NDArray[np.generic], ...]) -> object:
    if not isinstance(node, dict):
        return node
    if "class" in node:
        items = {name: _rebuilt(item, arrays) for name, item in node["fields"].items()}
        return _CLASSES[node["class"]](**items)
    ((kind, content),) = node.items()
    if kind == "array":
        return np.array(arrays[content], order="C")
    if kind == "scalar":
        return arrays[content][()]
    if kind == "outcome":
        return Outcome(content)
    if kind == "tuple":
        return tuple(_rebuilt(item, arrays) for item in content)
    if kind == "list":
        return [_rebuilt(item, arrays) for item in content]
    if kind == "dict":
        return {key: _rebuilt(item, arrays) for key, item in content.items()}
    raise ValueError(f"unknown kind of value: {kind}")


def in_rows(value: T) -> T:
    """A value whose arrays lie in memory in rows, as those that `unpack` gives."""
    found: Any = value
    if isinstance(value, np.ndarray):
        found = np.array(value, order="C")
    elif isinstance(value, tuple):
        found = tuple(in_rows(item) for item in value)
    elif is_dataclass(value) and not isinstance(value, type):
        found = replace(value, **{field.name: in_rows(getattr(value, field.name)) for field in fields(value)})
    return cast("T", found)
