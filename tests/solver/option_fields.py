"""The option classes of the solver: tuning constants with their meaning and evidence."""

import importlib
import pkgutil
from dataclasses import is_dataclass
from typing import Any

import solver


def all_options() -> dict[str, Any]:
    """The option instances of the solver by name."""
    options = {}
    for info in pkgutil.walk_packages(solver.__path__, "solver."):
        for name, value in vars(importlib.import_module(info.name)).items():
            if is_dataclass(value) and type(value).__name__.endswith("Options") and type(value).__module__ == info.name:
                options[name] = value
    return options
