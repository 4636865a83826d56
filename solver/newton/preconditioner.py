"""The factorisation of the Jacobian of a balance, as a preconditioner of GMRES. The choice depends on the joint:

- A march through the period (`period_preconditioner`).
- Where the march does not apply, the slip space (`slip_preconditioner`), as far as its largest directions: for small
  joints, for masses on sliders, and where the system of a sample is singular.

Each factorisation gives the sign of the determinant of the Jacobian, or of a matrix near the Jacobian.
"""

from __future__ import annotations

from solver.harmonic_balance.dlft import Linearisation
from solver.newton.options import NEWTON
from solver.newton.period_preconditioner import PeriodFactor, build_period_factor
from solver.newton.slip_preconditioner import SlipFactor, build_slip_factor, largest_directions

Factor = SlipFactor | PeriodFactor


def build_factor(tangent: Linearisation) -> Factor:
    """Factorisation of a Jacobian."""
    small = tangent.joint.component_index.size <= NEWTON.small_joint_displacements
    march = None if small else build_period_factor(tangent)
    if march is not None:
        return march
    return build_slip_factor(tangent, largest_directions(tangent, NEWTON.most_directions))
