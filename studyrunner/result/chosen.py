"""The point that a reader asks for, by values of axes."""

from __future__ import annotations

import math
from collections.abc import Mapping

import xarray as xr

from studyrunner.user_error import UserError

_PLACE = "command line"


def find_values(dataset: xr.Dataset, wanted: Mapping[str, str]) -> dict[str, float | str]:
    """Values of axes as they are in a file, from their texts.

    Raises
    ------
    UserError
        Where the file has no such axis, or the axis has no such value.
    """
    axes = [str(name) for name in dataset["outcome"].dims]
    found: dict[str, float | str] = {}
    for name, text in wanted.items():
        if name not in axes:
            raise UserError(_PLACE, "--point", f"{name}={text}", f"give one of the axes {', '.join(axes)}")
        values = dataset[name].values.tolist()
        near = [value for value in values if _is_value(value, text)]
        if not near:
            remedy = f"give one of the values of {name}: {', '.join(map(str, values[:12]))}"
            raise UserError(_PLACE, "--point", f"{name}={text}", remedy + (", ..." if len(values) > 12 else ""))
        found[name] = near[0]
    return found


def _is_value(value: float | str, text: str) -> bool:
    if isinstance(value, str):
        return value == text
    try:
        return math.isclose(value, float(text), rel_tol=1e-9)
    except ValueError:
        return False
