"""Curves of `peers` by tmdsimpy: prints JSON. tmdsimpy is made for nonlinear modes of bolted joints.

The slider has elastic friction: rigid friction is not its case. On the dovetail a spring closes the gap, and each of
two springs slides at the limit of Coulomb.
"""

import json
import sys
import time
from typing import Any

import numpy as np

SMALLEST = 1.0 / 8.0  # of the distance of two frequencies: the step after attempts that failed


def slider(asked: dict[str, Any]) -> tuple[Any, Any, Any, Any, Any]:
    """System, solver, load, first state and response of one mass."""
    from tmdsimpy.nlforces.vector_jenkins import VectorJenkins  # type: ignore[import-not-found]
    from tmdsimpy.solvers import NonlinearSolver  # type: ignore[import-not-found]
    from tmdsimpy.vibration_system import VibrationSystem  # type: ignore[import-not-found]

    mass, mount, damping = (np.array([[asked[name]]]) for name in ("mass", "mount", "damping"))
    system = VibrationSystem(mass, mount, C=damping)
    system.add_nl_force(VectorJenkins(np.eye(1), np.eye(1), asked["spring"], asked["friction"]))
    load = np.zeros(2 * asked["harmonics"] + 1)
    load[1] = asked["force"]
    return system, NonlinearSolver(), load, np.zeros(load.size), np.ones(1)


def dovetail(asked: dict[str, Any]) -> tuple[Any, Any, Any, Any, Any]:
    """System, solver, load, first state and response of pairs of three displacements, then modes."""
    from tmdsimpy.jax.nlforces.elastic_dry_fric_3d import ElasticDryFriction3D  # type: ignore[import-not-found]
    from tmdsimpy.jax.solvers import NonlinearSolverOMP  # type: ignore[import-not-found]
    from tmdsimpy.vibration_system import VibrationSystem  # type: ignore[import-not-found]

    with np.load(asked["file"]) as file:
        model = dict(file)
    n = len(model["M"])
    system = VibrationSystem(model["M"], model["K"], C=model["C"])
    for pair in range(asked["pairs"]):
        place = np.eye(n)[[3 * pair + 1, 3 * pair + 2, 3 * pair]]
        springs = (asked["stiffness"], asked["stiffness"], asked["friction"])
        system.add_nl_force(ElasticDryFriction3D(place, place.T.copy(), *springs))
    load = np.zeros(model["start"].size)
    load[: 2 * n] = np.concatenate([model["static"], model["cosine"]])
    newton = {"max_steps": asked["most"], "rtol": asked["tolerance"], "xtol": 1e-12, "stopping_tol": ["rtol"]}
    return system, NonlinearSolverOMP({**newton, "verbose": False}), load, model["start"], model["row"]


def curve(asked: dict[str, Any]) -> dict[str, Any]:
    """Frequencies, Hz, amplitudes, m, evaluations of the balance with its Jacobian, CPU seconds, failed attempts."""
    system, solver, load, state, row = (dovetail if "file" in asked else slider)(asked)
    orders, n, evaluations, failed = np.arange(asked["harmonics"] + 1), row.size, 0, 0
    frequencies, amplitudes = [], []
    waiting, smallest = asked["frequency"][::-1], SMALLEST * (asked["frequency"][1] - asked["frequency"][0])
    began = time.process_time()
    while waiting:
        frequency = waiting[-1]

        def balance(unknowns: np.ndarray, _: bool = True, rate: float = 2.0 * np.pi * frequency) -> Any:
            return system.hbm_res(np.hstack((unknowns, rate)), load, orders, Nt=asked["samples"])[0:2]

        found, _, _, said = solver.nsolve(balance, state, verbose=False)
        evaluations += said["nfev"]
        if said["success"]:
            state = np.asarray(found)
            frequencies.append(waiting.pop())
            amplitudes.append(float(np.hypot(row @ state[n : 2 * n], row @ state[2 * n : 3 * n])))
            continue
        failed += 1
        if not frequencies or frequency - frequencies[-1] < 2.0 * smallest:
            break  # the end of the curve
        waiting.append(0.5 * (frequencies[-1] + frequency))
    effort = {"iterations": evaluations, "seconds": time.process_time() - began, "failed": failed}
    return {"frequency": frequencies, "amplitude": amplitudes, **effort}


if __name__ == "__main__":
    given = json.loads(sys.argv[1])
    sys.path.insert(0, given["source"])
    curve({**given, "frequency": given["frequency"][:2]})  # compiles
    print(json.dumps(curve(given)))
