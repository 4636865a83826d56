"""The balance of an Euler step, at any fraction of the step: with given depths, or with depths that grow."""

from __future__ import annotations

from solver.contact.archard import wear_gain, wear_rate
from solver.contact.wear_law import WearingWork
from solver.harmonic_balance.dlft import Balance, Evaluation, worn_by
from solver.harmonic_balance.state import BalanceAt
from solver.model import FloatArray
from solver.settings import Scheme
from solver.structure.joint import Joint


def held_wear(joint: Joint, before: FloatArray, after: FloatArray) -> BalanceAt:
    """Balance at given depths (n_contact,), m, linear from `before` to `after` over the step, Eqs. (20), (23)."""

    def balance_at(fraction: float, history: FloatArray) -> Balance:
        return Balance.frozen(joint, history, before + fraction * (after - before))

    return balance_at


def implicit_wear(joint: Joint, before: FloatArray, gain: FloatArray, wearing: WearingWork) -> BalanceAt:
    """Balance with growth of the depths by `gain` times the wearing work of the new state, Eqs. (24) to (26).

    before (n_contact,): depths at the start of the step, m.
    gain (n_contact,): `archard.wear_gain` of the whole step, m/J.
    """

    def balance_at(fraction: float, history: FloatArray) -> Balance:
        return Balance(joint, history, before, fraction * gain, wearing)

    return balance_at


def euler_balance(
    joint: Joint, scheme: Scheme, before: Evaluation, length: float, wear_coefficient: float, wearing: WearingWork
) -> BalanceAt:
    """Balance of a step from a state: Eqs. (20), (23) for the explicit scheme, else Eqs. (24) to (26).

    Parameters
    ----------
    joint, before
        The joint and its state at the start of the step.
    scheme
        "explicit", "implicit", or "adaptive" for an implicit Euler step.
    length
        h, cycles.
    wear_coefficient
        k_w, 1/Pa.
    wearing
        Part of the slip work that wears.

    Returns
    -------
    BalanceAt
        The balance at a fraction of the step and for a tangential history.
    """
    area, depth = joint.contact.area, before.wear_depth
    if scheme == "explicit":
        return held_wear(
            joint, depth, depth + length * wear_rate(wear_coefficient, area, wearing.work(*worn_by(before)))
        )
    return implicit_wear(joint, depth, wear_gain(wear_coefficient, area, length), wearing)
