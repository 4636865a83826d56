"""Values of the solver as text and plain arrays for a file: the state of a history or of a sweep, a reduced model.

`unpack(pack(value))` is equal to `value` to the last bit, with arrays stored by rows (C order). The memory order
changes the last bits of sums: a computation that may be resumed goes on from the unpacked value.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from functools import cache
from typing import Any, TypeVar, cast, get_type_hints

import numpy as np
from numpy.typing import NDArray

from solver.model import ContactInterface, FloatArray, LinearModel, ReducedModel
from solver.outcome import Outcome

T = TypeVar("T")

_PLAIN: dict[Any, Any] = {float: float | int, int: int, str: str, bool: bool, FloatArray: np.ndarray}
"""Types of fields that are checked when a value is rebuilt, by their annotation."""

_CLASSES: dict[str, type[Any]] = {each.__name__: each for each in (ContactInterface, LinearModel, ReducedModel)}


@dataclass(frozen=True)
class Packed:
    """A value as JSON text that refers to arrays by their index."""

    text: str
    arrays: tuple[NDArray[np.generic], ...]

    @property
    def n_bytes(self) -> int:
        """Size in a file."""
        return len(self.text) + sum(array.nbytes for array in self.arrays)


Keep = Callable[[Packed | str], None]
"""Takes from time to time what another computation needs to go on, and, in words, where a computation is."""


def packable(known: type[T]) -> type[T]:
    """Decorator of frozen classes in the state of a wear history or of a sweep. Names are unique."""
    assert known.__name__ not in _CLASSES
    _CLASSES[known.__name__] = known
    return known


def pack(value: object) -> Packed:
    """Text and arrays of numbers, texts, None, arrays, tuples, lists, dicts, outcomes and packable classes.

    Raises TypeError for any other value: a bug.
    """
    arrays: list[NDArray[np.generic]] = []
    text = json.dumps(_described(value, arrays))
    return Packed(text, tuple(arrays))


def unpack(packed: Packed) -> Any:
    """The value that was packed.

    Raises ValueError, KeyError, TypeError or IndexError where text and arrays do not describe a value.
    """
    return _rebuilt(json.loads(packed.text), packed.arrays)


def in_rows(value: T) -> T:
    """The value with all arrays stored by rows (C order), as `unpack` returns them."""
    return cast("T", unpack(pack(value)))


def unpack_model(packed: Packed) -> ReducedModel:
    """As `unpack`; TypeError also where another value was packed."""
    model = unpack(packed)
    if not isinstance(model, ReducedModel):
        raise TypeError(type(model).__name__)
    return model


def _described(value: object, arrays: list[NDArray[np.generic]]) -> object:
    """JSON of a value, whose lists are pairs of a kind and its content; the arrays are appended to `arrays`."""
    # np.float64 is a float too, but a plain float divides by zero differently
    if isinstance(value, np.ndarray | np.generic):
        arrays.append(np.array(value, order="C"))
        return ["scalar" if isinstance(value, np.generic) else "array", len(arrays) - 1]
    if isinstance(value, Outcome):
        return ["outcome", int(value)]
    if value is None or isinstance(value, bool | int | float | str):
        return value
    name = type(value).__name__
    if isinstance(value, tuple | list):
        return [name, [_described(item, arrays) for item in value]]
    if isinstance(value, dict):
        return [name, [[key, _described(item, arrays)] for key, item in value.items()]]
    if is_dataclass(value) and _CLASSES.get(name) is type(value):
        return [name, {field.name: _described(getattr(value, field.name), arrays) for field in fields(value)}]
    raise TypeError(f"{name} is not a value that can be packed")


def _rebuilt(node: Any, arrays: tuple[NDArray[np.generic], ...]) -> Any:
    if not isinstance(node, list):
        return node
    kind, content = node
    if kind == "array":
        return np.array(arrays[content], order="C")
    if kind == "scalar":
        return arrays[content][()]
    if kind == "outcome":
        return Outcome(content)
    if kind in ("tuple", "list"):
        items = [_rebuilt(item, arrays) for item in content]
        return tuple(items) if kind == "tuple" else items
    if kind == "dict":
        return {key: _rebuilt(item, arrays) for key, item in content}
    made = _CLASSES[kind](**{name: _rebuilt(item, arrays) for name, item in dict(content).items()})
    for name, annotation in _annotations(kind).items():
        value = getattr(made, name)
        if not isinstance(value, _PLAIN.get(annotation, object)):
            raise TypeError(f"{kind}.{name} is of type {type(value).__name__}")
        if annotation == FloatArray and value.dtype != np.float64:
            raise TypeError(f"{kind}.{name} holds {value.dtype}")
    return made


@cache
def _annotations(kind: str) -> dict[str, Any]:
    return get_type_hints(_CLASSES[kind])
