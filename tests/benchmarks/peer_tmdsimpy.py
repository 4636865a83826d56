"""Slider of `peers` by tmdsimpy: prints JSON. tmdsimpy is made for nonlinear modes of bolted joints.

Its friction is elastic: rigid friction and the dovetail are not its cases.
"""

import json
import sys
import time
from typing import Any

import numpy as np

asked = json.loads(sys.argv[1])
sys.path.insert(0, asked["source"])

from tmdsimpy.nlforces.vector_jenkins import VectorJenkins  # type: ignore[import-not-found]  # noqa: E402
from tmdsimpy.solvers import NonlinearSolver  # type: ignore[import-not-found]  # noqa: E402
from tmdsimpy.vibration_system import VibrationSystem  # type: ignore[import-not-found]  # noqa: E402


def curve(wanted: list[float]) -> dict[str, Any]:
    """Frequencies, Hz, amplitudes, m, evaluations of the balance with its Jacobian, CPU seconds, failed attempts."""
    mass, mount, damping = (np.array([[asked[name]]]) for name in ("mass", "mount", "damping"))
    system, solver = VibrationSystem(mass, mount, C=damping), NonlinearSolver()
    system.add_nl_force(VectorJenkins(np.eye(1), np.eye(1), asked["spring"], asked["friction"]))
    orders = np.arange(asked["harmonics"] + 1)
    load = np.zeros(2 * asked["harmonics"] + 1)
    load[1] = asked["force"]
    state, evaluations, frequencies, amplitudes = np.zeros(load.size), 0, [], []
    began = time.process_time()
    for frequency in wanted:

        def balance(unknowns: np.ndarray, _: bool = True, rate: float = 2.0 * np.pi * frequency) -> Any:
            return system.hbm_res(np.hstack((unknowns, rate)), load, orders, Nt=asked["samples"])[0:2]

        found, _, _, said = solver.nsolve(balance, state, verbose=False)
        evaluations += said["nfev"]
        if said["success"]:
            state = np.asarray(found)
            frequencies.append(frequency)
            amplitudes.append(float(np.hypot(*state[1:3])))
    effort = {"iterations": evaluations, "seconds": time.process_time() - began}
    return {"frequency": frequencies, "amplitude": amplitudes, **effort, "failed": len(wanted) - len(frequencies)}


curve(asked["frequency"][:2])  # compiles
print(json.dumps(curve(asked["frequency"])))
