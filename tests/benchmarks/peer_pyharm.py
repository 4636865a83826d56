"""A curve of `peers` by pyHarm, in its environment: prints JSON. pyHarm is made for large joints, not one slider."""

import json
import logging
import sys
import time
from typing import Any

import numpy as np
import pyHarm  # type: ignore[import-not-found]

ARC = 20.0  # rad/s along the curve: steps of about 3 Hz


def curve(asked: dict[str, Any]) -> dict[str, Any]:
    """Frequencies, Hz, amplitudes, m, Newton iterations, CPU seconds."""
    friction = {"type": "Jenkins", "k": asked["spring"]}
    if asked["kind"] == "rigid":
        # The penalty of DLFT is the user's: with that of the mount the error at 5 harmonics is 38 % in the median.
        friction = {"type": "DLFTFriction", "eps": 1e3 * asked["mount"]}
    matrices = {"M": asked["mass"], "C": asked["damping"], "K": asked["mount"], "G": 0.0}
    place = {"connect": {"slider": [0]}, "dirs": [0]}
    matrix = {name: np.array([[value]]) for name, value in matrices.items()}
    newton = {"tol_residual": 1e-6, "tol_delta_x": 1e-9, "max_iter": 60}
    study = {
        "system": {"type": "Base", "nh": asked["harmonics"], "nti": asked["samples"], "adim": {"status": False}},
        "substructures": {"slider": {"matrix": matrix, "ndofs": 1, "nnodes": 1}},
        "connectors": {
            "force": {"type": "CosinusForcing", "amp": asked["force"], **place},
            "friction": {**friction, "mu": 1.0, "N0": asked["friction"], **place},
        },
        "kinematics": {},
        "analysis": {
            "curve": {
                "study": "frf",
                "solver": "NewtonRaphson",
                "solver_options": newton,
                "verbose": False,
                "puls_inf": 2.0 * np.pi * asked["first"],
                "puls_sup": 2.0 * np.pi * asked["last"],
                "ds0": ARC,
                "ds_max": ARC,
                "ds_min": 1e-6,
            }
        },
    }
    began = time.process_time()
    run = pyHarm.Maestro(study)
    run.operate()
    spent = time.process_time() - began
    points = run.nls["curve"].SolList
    found = [point for point in points if point.flag_accepted]
    return {
        "frequency": [float(point.x[-1]) / (2.0 * np.pi) for point in found],
        "amplitude": [float(np.hypot(point.x[1], point.x[2])) for point in found],
        "iterations": sum(int(point.iter_numb) for point in points),
        "seconds": spent,
    }


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    given = json.loads(sys.argv[1])
    curve(given)
    print(json.dumps(curve(given)))
