"""All that users of Python need, under the name of the distribution: `import fretwear`.

Everything that `solver`, `studies` and `studyrunner` export, loaded at its first use: `run_study`, `read_study`,
`open_result`; `build_scene`, `read_scene`, `build_model`; `frequency_response`, `march_wear`, `backbone`,
`integrate_mission`, `response_curve` and their results. Every `xarray.Dataset` has the accessor `fretwear`.
"""

from importlib import import_module
from typing import TYPE_CHECKING

import xarray as xr

import solver
import studies
import studyrunner

if TYPE_CHECKING:
    from solver import *  # noqa: F403
    from studies import *  # noqa: F403
    from studyrunner import *  # noqa: F403
    from studyrunner.accessor import join_results as join_results
    from studyrunner.statistics.study_statistics import worn_volume_statistics as worn_volume_statistics

_PLACES = {name: package.__name__ for package in (solver, studies, studyrunner) for name in package.__all__} | {
    "join_results": "studyrunner.accessor",
    "worn_volume_statistics": "studyrunner.statistics.study_statistics",
}
__all__ = sorted(_PLACES)

# until `studyrunner.accessor`, which takes a while to load, puts its own in place of this
xr.Dataset.fretwear = property(  # type: ignore[attr-defined]
    lambda dataset: import_module("studyrunner.accessor").FretwearAccessor(dataset)
)


def __getattr__(name: str) -> object:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_PLACES[name]), name)


def __dir__() -> list[str]:
    return __all__
