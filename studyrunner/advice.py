"""What to do about a point that failed, or that is known less well than was asked for.

It never names what was used already, nor what the scheme does not use: the adaptive scheme has no `step`, automatic
harmonics cannot be made more. The summary of a run and the report take all of their advice from here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

_SWEEPS = ("up", "down", "ramp")
_OF_ADAPTIVE_STEPS = ("adaptive", "final")

_OF_START = 1.0 / 6.0
"""Error of the wear rate of the start state over the error of the worn volume, from which on the second comes from the
first: errors grow while the joint wears (`blade_root`: 3.4 % became 13 %)."""

_FAR = 10.0
"""Errors of more than so many times `rtol` do not fall in proportion to it."""


@dataclass(frozen=True)
class Used:
    """What a point was computed with.

    scheme, sweep, rtol: of the point. harmonics, samples: "auto", or a number. schemes, sweeps: all of the study.
    by_depth: whether slow_time.largest_depth gives explicit steps, which then ignore `step`. until: whether the study
    has a target, slow_time.until.
    """

    scheme: str
    sweep: str
    harmonics: int | str = "auto"
    samples: int | str = "auto"
    rtol: float = 1e-2
    schemes: tuple[str, ...] = ()
    sweeps: tuple[str, ...] = ()
    by_depth: bool = False
    until: bool = False


def advise(outcome: str, used: Used) -> str:
    """A sentence on what may help against an outcome, which is a word of `flag_meanings`.

    Empty where the sentence of the outcome says all, where nothing is left to try, and for words not known here.
    """
    if outcome == "time_limit":
        return "--retry-failed continues with a larger solver.time_limit."
    finer, steps, adaptive = _given(used), _other_steps(used), used.scheme in _OF_ADAPTIVE_STEPS
    sweeps = tuple(f'sweep = "{sweep}"' for sweep in _SWEEPS if sweep not in (used.sweep, *used.sweeps))
    end = "another scheme with an end in " if used.scheme == "final" else "an end in "
    remedies = {
        # a ramp holds the frequency
        "resonance_lost": ("another range in loading.between", *(each for each in sweeps if "ramp" not in each)),
        "start_failed": (*finer, *sweeps),
        "branch_lost": (*finer, *sweeps),
        # more harmonics make no state stable
        "unstable": sweeps,
        "march_failed": (*finer, *steps),
        "step_too_long": steps,
        "sensitive": ("a smaller rtol",) if adaptive else steps,
        "inaccurate": finer,
        "certificate_failed": (*finer, "a smaller tolerance"),
        "no_final_state": (f"{end}slow_time.cycles{'' if used.until else ' or slow_time.until'}",),
    }.get(outcome, ())
    text = f"Try {' or '.join(remedies)}." if remedies else ""
    if outcome == "sensitive" and adaptive:
        text += " If both still differ then, the joint itself is that sensitive: use [scatter]."
    return text


def advise_error(error: float, wear_rate_error: Sequence[float], used: Used) -> str:
    """What would make the error of a worn volume smaller, in a few words.

    error: of the last worn volume, relative, above `rtol`. wear_rate_error: of the states, the first of the start state
    (NaN: not estimated); empty where they are not known.
    """
    of_start = len(wear_rate_error) > 0 and wear_rate_error[0] >= _OF_START * error > 0.0
    if _given(used) and of_start:
        return f"set {' and '.join(_given(used))}"
    if used.scheme not in _OF_ADAPTIVE_STEPS and not of_start:
        return f"set {' or '.join(_other_steps(used))}"
    if error >= _FAR * used.rtol:
        return "set a smaller solver.rtol"
    # steps, harmonics and the walk to the start state all go by rtol: what comes out is about as many times smaller
    digits, exponent = f"{used.rtol**2 / error:.12e}".split("e")
    return f"set solver.rtol = {float(f'{digits[:3]}e{exponent}'):g}"


def _given(used: Used) -> tuple[str, ...]:
    """Harmonics and samples of a given number, which may be automatic instead."""
    return tuple(f'{key} = "auto"' for key in ("harmonics", "samples") if getattr(used, key) != "auto")


def _other_steps(used: Used) -> tuple[str, ...]:
    """Steps that are shorter than those that were used, and schemes that the study does not have."""
    if used.scheme in _OF_ADAPTIVE_STEPS:
        shorter = "a smaller rtol, which makes the steps shorter"
        other = 'scheme = "implicit" with a small step'
        return (shorter,) if "implicit" in used.schemes else (f"{shorter},", other)
    by_depth = used.by_depth and used.scheme == "explicit"
    shorter = "a smaller slow_time.largest_depth" if by_depth else "a smaller step"
    return (shorter,) if "adaptive" in used.schemes else ('scheme = "adaptive"', shorter)
