"""Measured frequency responses in files of universal format (dataset 58), read by pyuff; in SI."""

import contextlib
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from studyrunner.user_error import UserError, Verbatim

SUFFIXES = (".uff", ".unv", ".uf", ".58")
"""Of the names of these files, in small letters."""

_FUNCTION, _UNITS = 58, 164  # kinds of datasets
_RESPONSE = 4  # function type of a frequency response; 1 is a signal, 2 an auto spectrum, 6 a coherence
_DERIVED = {8: 0, 11: 1, 12: 2}  # ordinates: displacement, velocity, acceleration
_FORCES = (9, 13)  # of denominators
_LENGTHS = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "g": 9.80665, "in": 0.0254}
_NEWTONS = {"N": 1.0, "mN": 1e-3, "kN": 1e3, "lbf": 4.4482216152605}


def read_response(path: Path, key: str, given: Mapping[str, Any]) -> dict[str, object]:
    """`over`, `at`, Hz, and `value`, m, of the amplitude under a force, from a complex frequency response of a file.

    key: of the study that has the file, for messages. given: its table: `force`, N, `record`, the number of the
    response in the file, from 1, which one that is alone does not need, and `between`, Hz. Responses of velocity and
    acceleration are divided by the frequency. Raises UserError.
    """
    place = str(path)
    if not isinstance(given.get("force"), int | float):
        remedy = "give force, N: the excitation amplitude at which the amplitude is compared"
        raise UserError(place, f"{key}.force", given.get("force"), remedy)
    sets = _read(path, key)
    functions = [each for each in sets if each.get("type") == _FUNCTION]
    number = given.get("record", 1 if len(functions) == 1 else None)
    if not isinstance(number, int) or not 1 <= number <= len(functions):
        listed = ", ".join(f"{at} {_name(each)}" for at, each in enumerate(functions[:12], 1))
        remedy = f"give the number of one of its functions: {listed}" if functions else "give a file with dataset 58"
        raise UserError(place, f"{key}.record", number, remedy)
    response = functions[number - 1]
    kind, over = response["ordinate_spec_data_type"], response["orddenom_spec_data_type"]
    values = np.asarray(response["data"])
    if response["func_type"] != _RESPONSE or not np.iscomplexobj(values) or kind not in _DERIVED or over not in _FORCES:
        complex_or = "complex" if np.iscomplexobj(values) else "real"
        found = f"record {number} has function type {response['func_type']}, {complex_or}, data {kind} over {over}"
        remedy = "give a complex frequency response (type 4) of displacement, velocity or acceleration (8, 11, 12)"
        raise UserError(place, key, Verbatim(found), f"{remedy} over a force (13)")
    frequency = np.asarray(response["x"], dtype=float)
    try:
        low, high = (float(each) for each in given.get("between", (0.0, np.inf)))
    except (TypeError, ValueError):
        raise UserError(place, f"{key}.between", given["between"], "give two frequencies, Hz") from None
    kept = (frequency > 0.0) & (frequency >= low) & (frequency <= high)
    amplitude = np.abs(values[kept]) / (2.0 * np.pi * frequency[kept]) ** _DERIVED[kind]
    amplitude *= given["force"] * _in_si(place, key, response, [each for each in sets if each.get("type") == _UNITS])
    if not kept.any() or not np.isfinite(amplitude).all():
        remedy = f"give a range in its {frequency.min():g} to {frequency.max():g} Hz where all values are finite"
        raise UserError(place, f"{key}.between", given.get("between"), remedy)
    return {"over": "frequency", "at": frequency[kept].tolist(), "value": amplitude.tolist()}


def _read(path: Path, key: str) -> list[dict[str, Any]]:
    """All datasets of functions and of units."""
    try:
        import pyuff

        with contextlib.redirect_stdout(io.StringIO()):
            file = pyuff.UFF(str(path))
            wanted = np.flatnonzero(np.isin(file.get_set_types(), (_FUNCTION, _UNITS))).tolist()
            found = file.read_sets(wanted) if wanted else []
    except ImportError:
        raise UserError(str(path), key, path.name, "install what reads it: pip install 'fretwear[uff]'") from None
    except Exception as error:  # the library raises anything
        raise UserError(str(path), key, path.name, f"give a file of universal format: {error}") from None
    return [found] if isinstance(found, dict) else list(found)


def _in_si(place: str, key: str, response: dict[str, Any], units: list[dict[str, Any]]) -> float:
    """What a value is times to be in m over N, but for the times that it is derived: by its labels, else by the units
    of the file.
    """

    def known(name: str, table: Mapping[str, float], dataset: str) -> float:
        label = str(response.get(f"{name}_axis_units_lab", "")).strip()
        own = label.split("/")[0].strip(" (")
        if own in table:
            return table[own]
        if label not in ("", "NONE") or not units:
            remedy = (
                f"label the axis with {', '.join(table)}, or leave the label empty and write a dataset 164 of units"
            )
            raise UserError(place, key, Verbatim(f'unit "{label}" of the {name} is not known'), remedy)
        return 1.0 / float(units[-1][dataset])

    return known("ordinate", _LENGTHS, "length") / known("orddenom", _NEWTONS, "force")


def _name(response: dict[str, Any]) -> str:
    """Node and direction of response and reference."""
    parts = (response.get(name, "") for name in ("rsp_node", "rsp_dir", "ref_node", "ref_dir"))
    return "{}:{:+d} by {}:{:+d}".format(*(int(part or 0) for part in parts))
