"""One case: a joint that vibrates and wears. Input: arrays. Output: frozen results. No files, MPI, xarray or studies.

For use in Python, from this package itself:

- `build_model`: a `ReducedModel` from mass, damping, stiffness and contact pairs;
- `frequency_response`: the joint over frequency, a `FrequencyResponse`;
- `backbone`: a nonlinear mode of the joint over its amplitude, a `Backbone`;
- `modal_response`: the response near a resonance from a nonlinear mode alone, a `ModalResponse`;
- `march_wear`: wear of the joint over the cycles at one frequency, a `WearHistory`;
- `tuned`: other limits of the solver for hard cases;
- `SolverSettings`: resolution and accuracy; `Outcome`: how a computation ended.

The rooms, from the ground up: `structure` (Fourier basis, condensation, penalty), `contact` (Coulomb friction and
unilateral contact through a period), `harmonic_balance` (the DLFT balance and its Jacobian), `newton` (iteration,
linear solvers, preconditioners), `stability`, `continuation` (natural and arc length, homotopies, first state,
transient), `accuracy` (number of harmonics, refinement, reference solution and errors, certificate), `results`,
`loading_history` (the unworn states of a sweep or a ramp), `modes` (nonlinear modes), `wear` (the integration over the
slow time). On top: `forced_response`, `nonlinear_modes`, `single_mode_theory`, `wear_history`, `tuning`. On the ground:
`model`, `model_from_matrices`, `settings`, `outcome`, `clock`, `packing`. `PHYSICS.md` has the equations in one sign
convention, the misprints of the paper, and measurements.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from solver.forced_response import FrequencyResponse, frequency_response
    from solver.model import ReducedModel
    from solver.model_from_matrices import build_model
    from solver.nonlinear_modes import Backbone, backbone
    from solver.outcome import Outcome
    from solver.results.history import WearHistory
    from solver.settings import SolverSettings
    from solver.single_mode_theory import ModalResponse, modal_response
    from solver.tuning import tuned
    from solver.wear_history import march_wear

__all__ = [
    "Backbone",
    "FrequencyResponse",
    "ModalResponse",
    "Outcome",
    "ReducedModel",
    "SolverSettings",
    "WearHistory",
    "backbone",
    "build_model",
    "frequency_response",
    "march_wear",
    "modal_response",
    "tuned",
]

# Loaded at the first use: rooms import each other through this package, and loading numba takes a while.
_PLACES = {
    "Backbone": "nonlinear_modes",
    "FrequencyResponse": "forced_response",
    "ModalResponse": "single_mode_theory",
    "Outcome": "outcome",
    "ReducedModel": "model",
    "SolverSettings": "settings",
    "WearHistory": "results.history",
    "backbone": "nonlinear_modes",
    "build_model": "model_from_matrices",
    "frequency_response": "forced_response",
    "march_wear": "wear_history",
    "modal_response": "single_mode_theory",
    "tuned": "tuning",
}


def __getattr__(name: str) -> object:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_PLACES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
