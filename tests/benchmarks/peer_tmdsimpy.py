"""A curve of `peers` by tmdsimpy: prints JSON. tmdsimpy has elastic friction only, rigid friction is not its case."""

import json
import sys
import time
from typing import Any

import numpy as np


def curve(asked: dict[str, Any]) -> dict[str, Any]:
    """Frequencies, Hz, amplitudes, m, evaluations of the balance with its Jacobian, CPU seconds."""
    from tmdsimpy.nlforces.vector_jenkins import VectorJenkins  # type: ignore[import-not-found]
    from tmdsimpy.solvers import NonlinearSolver  # type: ignore[import-not-found]
    from tmdsimpy.vibration_system import VibrationSystem  # type: ignore[import-not-found]

    system = VibrationSystem(
        np.array([[asked["mass"]]]), np.array([[asked["mount"]]]), C=np.array([[asked["damping"]]])
    )
    system.add_nl_force(VectorJenkins(np.eye(1), np.eye(1), asked["spring"], asked["friction"]))
    orders = np.arange(asked["harmonics"] + 1)
    load = np.zeros(2 * asked["harmonics"] + 1)
    load[1] = asked["force"]
    solver, state, evaluations = NonlinearSolver(), np.zeros(load.size), 0
    frequencies, amplitudes = [], []
    began = time.process_time()
    for frequency in np.linspace(asked["first"], asked["last"], asked["n_frequencies"]):

        def balance(unknowns: np.ndarray, _: bool = True, rate: float = 2.0 * np.pi * frequency) -> Any:
            return system.hbm_res(np.hstack((unknowns, rate)), load, orders, Nt=asked["samples"])[0:2]

        state, _, _, said = solver.nsolve(balance, state, verbose=False)
        evaluations += said["nfev"]
        if said["success"]:
            frequencies.append(float(frequency))
            amplitudes.append(float(np.hypot(state[1], state[2])))
    spent = time.process_time() - began
    return {"frequency": frequencies, "amplitude": amplitudes, "iterations": evaluations, "seconds": spent}


if __name__ == "__main__":
    given = json.loads(sys.argv[1])
    sys.path.insert(0, given["source"])
    curve(given)
    print(json.dumps(curve(given)))
