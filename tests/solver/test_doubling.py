"""Period doubling against the multipliers of the exact motion, and as an outcome."""

from __future__ import annotations

import numpy as np
import pytest

from solver.balance import Balance, Evaluation
from solver.continuation import follow_branch
from solver.doubling import doubles_period, linearise_over_two, two_periods
from solver.history import StartState
from solver.joint import Joint, build_case
from solver.march import march_wear
from solver.model import FloatArray
from solver.outcome import Outcome
from solver.settings import SolverSettings
from tests.event_driven import Orbit
from tests.solver.models import cyclic_model, random_balance, random_model
from tests.solver.random_orbits import Scene, wall
