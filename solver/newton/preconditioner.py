"""The factorisation of the Jacobian of a balance, as a preconditioner of GMRES. The choice depends on the state:

- A space of slip and separation is factorised exactly (`slip_preconditioner`) where this is cheapest (`cost`).
- For a larger space, the factorisation is a march through the period (`period_preconditioner`).
- Where the march does not apply, the largest directions of the space are factorised: for masses on sliders, and where
  the system of a sample is singular.

Each factorisation gives the sign of the determinant of the Jacobian, or of a matrix near the Jacobian.
"""

from __future__ import annotations

from solver.harmonic_balance.dlft import Linearisation
from solver.newton.cost import worthwhile_directions
from solver.newton.options import NEWTON
from solver.newton.period_preconditioner import PeriodFactor, build_period_factor
from solver.newton.slip_preconditioner import SlipFactor, build_slip_factor, find_slip_space, largest_directions

Factor = SlipFactor | PeriodFactor


def build_factor(tangent: Linearisation) -> Factor:
    """Factorisation of a Jacobian."""
    space = find_slip_space(tangent, worthwhile_directions(tangent))
    found = None if space is not None else build_period_factor(tangent)
    if found is not None:
        return found
    return build_slip_factor(tangent, space or largest_directions(tangent, NEWTON.most_directions))
