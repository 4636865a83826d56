"""What a slow step is solved for: the balance at a share of it, with depths that are given or grow with the motion."""

from __future__ import annotations

from solver.harmonic_balance.converged import BalanceAt
from solver.harmonic_balance.dlft import Balance
from solver.model import FloatArray
from solver.structure.joint import Joint


def held_wear(joint: Joint, before: FloatArray, after: FloatArray) -> BalanceAt:
    """Depths (n_contact,), m, independent of the motion: from `before` at share 0 to `after` at 1, Eqs. (20), (23)."""

    def balance_at(share: float, history: FloatArray) -> Balance:
        return Balance.frozen(joint, history, before + share * (after - before))

    return balance_at


def implicit_wear(joint: Joint, before: FloatArray, gain: FloatArray) -> BalanceAt:
    """Depths that grow by `gain` (n_contact,), m/J, times the slip work of the state that is sought, Eqs. (24), (25).

    gain: `archard.wear_gain` of the whole step.
    """

    def balance_at(share: float, history: FloatArray) -> Balance:
        return Balance(joint, history, before, share * gain)

    return balance_at
