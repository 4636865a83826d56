"""How wide pairs have to be laid for what gross slip will wear: the scar grows beyond the unworn contact, without end.

Worn flat, a body of radius R lies on the other over a half-width b: wear has removed a segment of area `2 b^3 / (3 R)`
of a cylinder, a cap of volume `pi b^4 / (4 R)` of a sphere, and its depth is `b^2 / (2 R)`. By Archard's law the volume
is at most `4 k_w N P s` after N cycles of stroke s under the force P.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

_MARGIN = 1.1
"""Over b from volume and unworn contact, `b^3 = a^3 + 3 R A / 2` or `b^4 = a^4 + 4 R V / pi`. Measured with uniform
slip: up to 5 a the scar is 0.93 to 1.041 times that wide; from the depth, `b^2 = a^2 + 2 R W`, 0.90 to 1.012 times."""


@dataclass(frozen=True)
class ExpectedWear:
    """What a study wears at most.

    amplitude: largest excitation amplitude. per_slip_work: largest `k_w N`, m3/J: volume worn over slip work of a
    cycle; inf where cycles have no end. volume, m3, and depth, m: at which the wear ends, inf where they end nothing.
    """

    amplitude: float
    per_slip_work: float
    volume: float = math.inf
    depth: float = math.inf


@dataclass(frozen=True)
class Scar:
    """Half-width of a worn contact, m. radius: R, m. contact: a, m, of the unworn one.

    exponent, form: n and c of `b^n = a^n + c R V`.
    """

    radius: float
    contact: float
    exponent: int
    form: float

    def half_width(self, volume: float, depth: float) -> float:
        """Where both volume, m3, and depth, m, are at most these: with a margin; inf where neither has an end."""
        n = self.exponent
        by_volume = math.pow(self.contact**n + self.form * self.radius * volume, 1.0 / n)
        by_depth = math.sqrt(self.contact**2 + 2.0 * self.radius * depth)
        return _MARGIN * min(by_volume, by_depth)


def round_up(width: float) -> float:
    """To three digits, as a study shows it."""
    unit = 10.0 ** (math.floor(math.log10(width)) - 2)
    return float(f"{math.ceil(width / unit * (1.0 - 1e-9)) * unit:.6g}")
