"""A friction damper between neighbouring blades against Griffin's closed form.

In phase resonance the excitation feeds in pi F A a period; a slider behind a spring k takes 4 S (r A - S / k), with its
friction force S and the relative amplitude of both blades r A, r = 2 sin(pi d / N). So the amplitude is
A = 4 S^2 / (k (4 r S - pi F)), and smallest, pi F / (r^2 k), with S = pi F / (2 r). It holds where the blade has one
harmonic; here the slider has one, too.
(J. H. Griffin, J. Eng. Power 102 (1980) 329, for a blade with a damper to the ground, r = 1.)
"""

import numpy as np
import pytest

from solver import SolverSettings, build_model, march_wear

N, D = 24, 3
BLADE, MASS, SPRING, FORCE, FRICTION = 1e5, 0.1, 2e4, 1.0, 0.5  # N/m, kg, N/m, N, -
RATIO = 2.0 * np.sin(np.pi * D / N)


def damped_blade(friction_force):
    """Displacements: slip of the damper against the next blade, and of this blade; the spring lies between both."""
    stiffness = {}
    for k in range(N // 2 + 1):
        apart = 1.0 - np.exp(2j * np.pi * k / N)
        stiffness[k] = np.array(
            [[SPRING, -SPRING * apart], [-SPRING * np.conj(apart), BLADE + SPRING * abs(apart) ** 2]]
        )
    return build_model(
        dict.fromkeys(stiffness, np.diag([0.0, MASS])),
        None,
        stiffness,
        [[-1, 0, -1]],
        1e-4,
        load_harmonic=[0.0, 1.0],
        response=dict.fromkeys(stiffness, np.array([[0.0, 1.0]])),
        normal_load=friction_force / FRICTION,
        n_sectors=N,
        nodal_diameter=D,
    )


@pytest.mark.slow
@pytest.mark.parametrize(("harmonics", "within"), [(1, 2e-3), (9, 1e-2)])
@pytest.mark.parametrize("over_optimum", [0.8, 1.0, 2.0])
def test_the_resonance_of_a_damped_blade_is_griffins(harmonics, within, over_optimum):
    slip = over_optimum * np.pi * FORCE / (2.0 * RATIO)
    amplitude = 4.0 * slip**2 / (SPRING * (4.0 * RATIO * slip - np.pi * FORCE))
    assert amplitude >= np.pi * FORCE / (RATIO**2 * SPRING) * (1.0 - 1e-12)
    found = march_wear(
        damped_blade(slip),
        "resonance",
        FORCE,
        FRICTION,
        0.0,
        1.0,
        between=(150.0, 200.0),
        settings=SolverSettings(harmonics=harmonics, samples=1024),
    )
    assert abs(found.response[0, 0]) == pytest.approx(amplitude, rel=within)
