"""One case: a joint that vibrates and wears. Input: arrays. Output: frozen results. No files, MPI, xarray or studies.

For use in Python, from this package itself:

- `build_model`: a `ReducedModel` from mass, damping, stiffness and contact pairs;
- `CubicSprings`, `IwanJoints`: pairs that do not rub, but are on springs or slip little by little, for `build_model`;
- `with_contact_stiffness`: the model with a spring in series with each pair, as rough surfaces are;
- `build_ring`: all sectors of a cyclic structure, whose blades may differ, from the model of one;
- `with_evolution`: the model of a joint whose friction, contact stiffness or wear coefficient change while it rubs;
- `frequency_response`: the joint over frequency, a `FrequencyResponse`;
- `backbone`: a nonlinear mode of the joint over its amplitude, a `Backbone`;
- `modal_response`: the response near a resonance from a nonlinear mode alone, a `ModalResponse`;
- `allowable_amplitude`: the excitation at which the wear just meets a `WearTarget`, an `Allowable`;
- `march_wear`: wear of the joint over the cycles at one frequency, a `WearHistory`;
- `integrate_mission`: wear over missions, each a list of `Block`, steady or a `Passage`, a `MissionHistory`;
- `response_curve`: a whole curve over frequency or excitation amplitude, with folds, unstable parts and Floquet
  multipliers, a `ResponseCurve`;
- `balance_of`: the equations of a periodic state, a `HarmonicBalance`, with residual, exact Jacobian, all Fourier
  coefficients and time signals of a state as a `PeriodicMotion`, and its sensitivities to all parameters as a
  `Gradient`;
- `SolverSettings`: resolution and accuracy; `Outcome`: how a computation ended.

`CONTRIBUTING.md` has a map of the rooms. `PHYSICS.md` has the equations in one sign convention, the misprints of the
paper, and measurements.
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from solver.allowable import Allowable as Allowable
    from solver.allowable import allowable_amplitude as allowable_amplitude
    from solver.compliant_contact import with_contact_stiffness as with_contact_stiffness
    from solver.compliant_contact import with_evolution as with_evolution
    from solver.contact.iwan import IwanJoints as IwanJoints
    from solver.contact.springs import CubicSprings as CubicSprings
    from solver.forced_response import FrequencyResponse as FrequencyResponse
    from solver.forced_response import HarmonicBalance as HarmonicBalance
    from solver.forced_response import balance_of as balance_of
    from solver.forced_response import frequency_response as frequency_response
    from solver.histories import integrate_mission as integrate_mission
    from solver.histories import march_wear as march_wear
    from solver.missions.mission import Block as Block
    from solver.missions.mission import MissionHistory as MissionHistory
    from solver.model import ReducedModel as ReducedModel
    from solver.model_from_matrices import build_model as build_model
    from solver.nonlinear_modes import Backbone as Backbone
    from solver.nonlinear_modes import ModalResponse as ModalResponse
    from solver.nonlinear_modes import backbone as backbone
    from solver.nonlinear_modes import modal_response as modal_response
    from solver.outcome import Outcome as Outcome
    from solver.results.gradient import Gradient as Gradient
    from solver.results.history import WearHistory as WearHistory
    from solver.results.state_report import PeriodicMotion as PeriodicMotion
    from solver.settings import Passage as Passage
    from solver.settings import SolverSettings as SolverSettings
    from solver.settings import WearTarget as WearTarget
    from solver.structure.ring import build_ring as build_ring
    from solver.whole_response import ResponseCurve as ResponseCurve
    from solver.whole_response import response_curve as response_curve

# Loaded at the first use: rooms import each other through this package, and loading numba takes a while.
_NAMES = {
    "allowable": "Allowable allowable_amplitude",
    "compliant_contact": "with_contact_stiffness with_evolution",
    "contact.iwan": "IwanJoints",
    "contact.springs": "CubicSprings",
    "forced_response": "FrequencyResponse HarmonicBalance balance_of frequency_response",
    "histories": "integrate_mission march_wear",
    "missions.mission": "Block MissionHistory",
    "model": "ReducedModel",
    "model_from_matrices": "build_model",
    "nonlinear_modes": "Backbone ModalResponse backbone modal_response",
    "outcome": "Outcome",
    "results.gradient": "Gradient",
    "results.history": "WearHistory",
    "results.state_report": "PeriodicMotion",
    "settings": "Passage SolverSettings WearTarget",
    "structure.ring": "build_ring",
    "whole_response": "ResponseCurve response_curve",
}
_PLACES = {name: place for place, names in _NAMES.items() for name in names.split()}

if not TYPE_CHECKING:
    __all__ = list(_PLACES)


def __getattr__(name: str) -> object:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_PLACES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_PLACES})
