"""The factorisation of the balance's Jacobian that preconditions GMRES, chosen by the state.

- In the space in which the pairs slip or open, where that is small (`slip_preconditioner`): exact.
- By a march through the period, where that space is large (`period_preconditioner`).
- In the largest directions of that space, where the march does not apply: for masses on sliders, and where the system
  of a sample is singular.

Each has the sign of the determinant of the Jacobian, or that of a matrix near it.
"""

from __future__ import annotations

from solver.harmonic_balance.dlft import Linearisation
from solver.newton.options import NEWTON
from solver.newton.period_preconditioner import PeriodFactor, build_period_factor
from solver.newton.slip_preconditioner import SlipFactor, build_slip_factor, find_slip_space, largest_directions

Factor = SlipFactor | PeriodFactor


def build_factor(tangent: Linearisation) -> Factor:
    """Factorisation of a Jacobian."""
    few = tangent.joint.component_index.size <= NEWTON.small_joint_displacements
    space = find_slip_space(tangent, NEWTON.most_directions if few else NEWTON.exact_directions)
    found = None if space is not None else build_period_factor(tangent)
    if found is not None:
        return found
    return build_slip_factor(tangent, space or largest_directions(tangent, NEWTON.partial_directions))
