"""What an Euler step is solved for: the balance at a fraction of it, with depths that are given or that grow."""

from __future__ import annotations

from solver.contact.archard import wear_gain, wear_rate
from solver.contact.wear_law import WearingWork
from solver.harmonic_balance.converged import BalanceAt
from solver.harmonic_balance.dlft import Balance, Evaluation, worn_by
from solver.model import FloatArray
from solver.settings import Scheme
from solver.structure.joint import Joint


def held_wear(joint: Joint, before: FloatArray, after: FloatArray) -> BalanceAt:
    """Depths (n_contact,), m, held: from `before` at fraction 0 of the step to `after` at 1, Eqs. (20), (23)."""

    def balance_at(fraction: float, history: FloatArray) -> Balance:
        return Balance.frozen(joint, history, before + fraction * (after - before))

    return balance_at


def implicit_wear(joint: Joint, before: FloatArray, gain: FloatArray, wearing: WearingWork) -> BalanceAt:
    """Depths that grow by `gain` (n_contact,), m/J, times the wearing work of the state sought, Eqs. (24) to (26).

    gain: `archard.wear_gain` of the whole step.
    """

    def balance_at(fraction: float, history: FloatArray) -> Balance:
        return Balance(joint, history, before, fraction * gain, wearing)

    return balance_at


def euler_balance(
    joint: Joint, scheme: Scheme, before: Evaluation, length: float, wear_coefficient: float, wearing: WearingWork
) -> BalanceAt:
    """What a step from a state is solved for: Eqs. (20), (23) if explicit, else Eqs. (24) to (26).

    Parameters
    ----------
    joint, before
        The joint and its state at the start of the step.
    scheme
        The adaptive scheme takes implicit Euler steps.
    length
        h, cycles.
    wear_coefficient
        k_w, 1/Pa.
    wearing
        What of the slip work wears.

    Returns
    -------
    BalanceAt
        The balance at a fraction of the step, for a start history.
    """
    area, depth = joint.contact.area, before.wear_depth
    if scheme == "explicit":
        return held_wear(
            joint, depth, depth + length * wear_rate(wear_coefficient, area, wearing.work(*worn_by(before)))
        )
    return implicit_wear(joint, depth, wear_gain(wear_coefficient, area, length), wearing)
