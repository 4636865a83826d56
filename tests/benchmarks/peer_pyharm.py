"""Curves of `peers` by pyHarm, in its environment: prints JSON. pyHarm is made for large joints, not for one slider.

On the dovetail `Rigid` is the law of pyHarm's rigid contact, `DLFT3D`, which between a body and the ground divides the
force by two bodies and lacks the derivative of the linear forces in its Jacobian: here the ground counts as no body,
and the derivative is there.

pyHarm's closing is negative: the normal displacements change their sign.
"""

import json
import logging
import sys
import time
from typing import Any

import jax
import numpy as np
import pyHarm  # type: ignore[import-not-found]
from pyHarm.Elements.NodeToNodeElements.DLFTElements.DLFT3D import (  # type: ignore[import-not-found]
    DLFT3D,
    DLFTFriction3DResidual_jax,
)
from pyHarm.Elements.SubstructureMatrixElements.MatrixElement import MatrixElement  # type: ignore[import-not-found]
from pyHarm.Systems.System import System  # type: ignore[import-not-found]

ARC = 20.0  # rad/s along the curve of the slider: steps of about 3 Hz
_slopes = jax.jit(jax.jacfwd(DLFTFriction3DResidual_jax, argnums=(0, 2)))


class Load(MatrixElement):  # type: ignore[misc]
    """Static load and first cosine on all displacements of the root; pyHarm's own forcing takes one at a time."""

    factory_keyword = "Load"

    def _generateMatrices(self, data: dict[str, Any]) -> None:  # noqa: N802
        self.load = np.zeros(len(self.nabla) * len(data["static"]))
        self.load[: 2 * len(data["static"])] = np.concatenate([data["static"], data["cosine"]])

    def __flag_update__(self) -> None:
        self.flag_extforcing, self.flag_elemtype = True, -1

    def adim(self, *_: float) -> None:
        """Nothing: the system keeps its units."""

    def evalResidual(self, *_: Any) -> Any:  # noqa: N802
        """Force on the left side, N."""
        return -self.load

    def evalJacobian(self, *_: Any) -> Any:  # noqa: N802
        """Zero, for displacements and frequency."""
        return np.zeros((self.load.size, self.load.size)), np.zeros(self.load.size)


class Rigid(DLFT3D):  # type: ignore[misc]
    """pyHarm's rigid contact, to the ground."""

    factory_keyword = "Rigid"

    def __post_init__(self) -> None:
        super().__post_init__()
        self.nbSub = 1

    def evalJacobian(self, x: Any, omega: float, Rglin: Any, dJgdomlin: Any, **_: Any) -> Any:  # noqa: N802
        """Derivatives, those by the linear forces beside (`through`)."""
        own = (self.Pdir, self.Pslave, self.Pmaster, self.mu, self.N0, self.g, self.eps, self.D["ft"], self.D["tf"])
        direct, through = _slopes(x[self.indices], omega, Rglin[self.indices], float(self.nbSub), *own)
        self.through = np.asarray(through)
        return np.asarray(direct), self.through @ dJgdomlin[self.indices]


class WholeSlope(System):  # type: ignore[misc]
    """A system whose rigid pairs see all displacements through the linear forces."""

    factory_keyword = "WholeSlope"

    def _jacobian(self, elements: Any, x: Any, **known: Any) -> Any:
        slope, by_omega = super()._jacobian(elements, x, **known)
        for pair in elements if "dJgdxlin" in known else ():
            slope[pair.indices] += pair.through @ known["dJgdxlin"][pair.indices]
        return slope, by_omega


def slider(asked: dict[str, Any]) -> dict[str, Any]:
    """The input of pyHarm for one mass, whose friction is elastic, or rigid with a penalty."""
    friction = {"type": "Jenkins", "k": asked["spring"]}
    if asked["kind"] == "rigid":
        # The penalty of DLFT is the user's: with that of the mount the error at 5 harmonics is 38 % in the median.
        friction = {"type": "DLFTFriction", "eps": 1e3 * asked["mount"]}
    matrices = {"M": asked["mass"], "C": asked["damping"], "K": asked["mount"], "G": 0.0}
    place = {"connect": {"slider": [0]}, "dirs": [0]}
    matrix = {name: np.array([[value]]) for name, value in matrices.items()}
    connectors = {
        "force": {"type": "CosinusForcing", "amp": asked["force"], **place},
        "friction": {**friction, "mu": 1.0, "N0": asked["friction"], **place},
    }
    body = {"slider": {"matrix": matrix, "ndofs": 1, "nnodes": 1}}
    newton = {"tol_residual": 1e-6, "tol_delta_x": 1e-9, "max_iter": 60}
    first, last = (2.0 * np.pi * asked[name] for name in ("first", "last"))
    course = {"puls_inf": first, "puls_sup": last, "ds0": ARC, "ds_max": ARC, "ds_min": 1e-6}
    return study_of(asked, {"substructures": body, "connectors": connectors}, newton, course)


def dovetail(asked: dict[str, Any], model: dict[str, Any]) -> dict[str, Any]:
    """The input of pyHarm for pairs of three displacements, then modes."""
    n_pairs, omega = asked["pairs"], 2.0 * np.pi * np.array(asked["frequency"])
    pair = {"type": "Rigid", "eps": asked["penalty"], "mu": asked["friction"], "N0": 0.0, "g": 0.0, "dirs": [0, 1, 2]}
    matrix = {name: model[name] for name in "MCK"} | {"G": np.zeros_like(model["M"])}
    body = {"matrix": matrix, "ndofs": 3, "nnodes": n_pairs, "nmodes": len(model["M"]) - 3 * n_pairs}
    connectors = {
        "load": {"type": "Load", "connect": "root", "static": model["static"], "cosine": model["cosine"]},
        **{f"pair{i}": {**pair, "connect": {"root": [i]}} for i in range(n_pairs)},
    }
    newton = {"tol_residual": asked["tolerance"], "tol_delta_x": 1e-9, "max_iter": asked["most"]}
    step = float(omega[1] - omega[0])
    course = {"predictor": "previous", "corrector": "nocontinuation", "ds0": step, "ds_max": step}
    course |= {"ds_min": step / 64.0, "puls_inf": float(omega[0]), "puls_sup": float(omega[-1]) - 1e-3 * step}
    parts = {"plugin": [Load, Rigid, WholeSlope], "substructures": {"root": body}, "connectors": connectors}
    return study_of(asked, parts, newton, course, "WholeSlope")


def study_of(
    asked: dict[str, Any], parts: dict[str, Any], newton: dict[str, Any], course: dict[str, Any], system: str = "Base"
) -> dict[str, Any]:
    """The input of pyHarm: parts of the model, settings of Newton's method, and the way along the frequencies."""
    curve = {"study": "frf", "solver": "NewtonRaphson", "solver_options": newton, "verbose": False, **course}
    resolution = {"nh": asked["harmonics"], "nti": asked["samples"], "adim": {"status": False}}
    return {"system": {"type": system, **resolution}, "kinematics": {}, "analysis": {"curve": curve}, **parts}


def curve(asked: dict[str, Any]) -> dict[str, Any]:
    """Frequencies, Hz, amplitudes, m, Newton iterations, CPU seconds, failed attempts."""
    row, start, model = np.ones(1), {}, {}
    if "file" in asked:
        with np.load(asked["file"]) as file:
            model = dict(file)
        sign = np.ones(len(model["M"]))
        sign[: 3 * asked["pairs"] : 3] = -1.0
        for name in "MCK":
            model[name] = sign[:, None] * model[name] * sign
        for name in ("static", "cosine", "row"):
            model[name] = sign * model[name]
        row = model["row"]
        start = {"x0": (np.tile(sign, 2 * asked["harmonics"] + 1) * model["start"]).copy()}
    began, n = time.process_time(), row.size
    run = pyHarm.Maestro(dovetail(asked, model) if model else slider(asked))
    run.operate(**start)
    spent = time.process_time() - began
    points = run.nls["curve"].SolList
    found = [point for point in points if point.flag_accepted]
    return {
        "frequency": [float(point.x[-1]) / (2.0 * np.pi) for point in found],
        "amplitude": [float(np.hypot(row @ point.x[n : 2 * n], row @ point.x[2 * n : 3 * n])) for point in found],
        "iterations": sum(int(point.iter_numb) for point in points),
        "seconds": spent,
        "failed": len(points) - len(found),
    }


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    given = json.loads(sys.argv[1])
    curve({**given, "frequency": given["frequency"][:2]})  # compiles
    print(json.dumps(curve(given)))
