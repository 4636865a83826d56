"""One case: a joint that vibrates and wears. Input: arrays. Output: frozen results. No files, MPI, xarray or studies.

For use in Python, from this package itself:

- `build_model`: a `ReducedModel` from mass, damping, stiffness and contact pairs;
- `frequency_response`: the joint over frequency, a `FrequencyResponse`;
- `backbone`: a nonlinear mode of the joint over its amplitude, a `Backbone`;
- `march_wear`: wear of the joint over the cycles at one frequency, a `WearHistory`;
- `integrate_mission`: wear over missions, each a list of `Block`, steady or a `Passage`, a `MissionHistory`;
- `tuned`: other limits of the solver for hard cases;
- `SolverSettings`: resolution and accuracy; `Outcome`: how a computation ended.

The rooms, from the ground up: `structure` (Fourier basis, condensation, penalty), `contact` (Coulomb friction and
unilateral contact through a period), `harmonic_balance` (the DLFT balance and its Jacobian), `newton` (iteration,
linear solvers, preconditioners), `stability`, `continuation` (natural and arc length, homotopies, first state,
transient), `accuracy` (number of harmonics, refinement, reference solution and errors, certificate), `results`,
`loading_history` (the unworn states of a sweep or a ramp), `modes` (nonlinear modes), `wear` (the integration over the
slow time), `missions` (blocks in order). On top: `forced_response`, `nonlinear_modes`, `wear_history`,
`mission_history`, `tuning`. On the ground: `model`, `model_from_matrices`, `settings`, `outcome`, `clock`, `packing`.
`PHYSICS.md` has the equations in one sign convention, the misprints of the paper, and measurements.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from solver.forced_response import FrequencyResponse, frequency_response
    from solver.mission_history import integrate_mission
    from solver.missions.blocks import Block, Passage
    from solver.missions.result import MissionHistory
    from solver.model import ReducedModel
    from solver.model_from_matrices import build_model
    from solver.nonlinear_modes import Backbone, backbone
    from solver.outcome import Outcome
    from solver.results.history import WearHistory
    from solver.settings import SolverSettings
    from solver.tuning import tuned
    from solver.wear_history import march_wear

__all__ = [
    "Backbone",
    "Block",
    "FrequencyResponse",
    "MissionHistory",
    "Outcome",
    "Passage",
    "ReducedModel",
    "SolverSettings",
    "WearHistory",
    "backbone",
    "build_model",
    "frequency_response",
    "integrate_mission",
    "march_wear",
    "tuned",
]

# Loaded at the first use: rooms import each other through this package, and loading numba takes a while.
_PLACES = {
    "Backbone": "nonlinear_modes",
    "Block": "missions.blocks",
    "FrequencyResponse": "forced_response",
    "MissionHistory": "missions.result",
    "Outcome": "outcome",
    "Passage": "missions.blocks",
    "ReducedModel": "model",
    "SolverSettings": "settings",
    "WearHistory": "results.history",
    "backbone": "nonlinear_modes",
    "build_model": "model_from_matrices",
    "frequency_response": "forced_response",
    "integrate_mission": "mission_history",
    "march_wear": "wear_history",
    "tuned": "tuning",
}


def __getattr__(name: str) -> object:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_PLACES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
