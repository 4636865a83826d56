"""The key that was meant by one that is not known.

By hand are the other names: `difflib` finds spelling mistakes.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_OTHER_NAMES = {
    "axes": ("axis", "parameters"),
    "cycles": ("n_cycles", "n"),
    "density": ("rho",),
    "excitation_amplitude": ("amplitude", "excitation", "force", "f"),
    "frequency": ("frequencies", "freq", "omega"),
    "friction_coefficient": ("mu", "friction", "cof"),
    "harmonics": ("n_harmonics", "nh"),
    "loss_factor": ("damping", "eta"),
    "mesh": ("mesh_density", "refinement"),
    "nodal_diameter": ("nd", "engine_order", "eo"),
    "poisson_ratio": ("nu", "poisson"),
    "rotation_speed": ("rpm", "speed"),
    "rtol": ("accuracy", "relative_tolerance"),
    "samples": ("n_samples", "nt"),
    "slow_time": ("wear_time", "cycles"),
    "step": ("h", "delta_n", "cycle_jump"),
    "wear_coefficient": ("k_w", "kw", "k", "alpha", "archard"),
    "young_modulus": ("e", "young", "youngs_modulus"),
}
"""What the literature and other programs call the keys of a study."""


def nearest_name(name: str, known: Iterable[str]) -> str:
    """The known name that is meant by `name`, or all of them: "one of a, b"."""
    names = list(known)
    for key in names:
        if name.lower() in _OTHER_NAMES.get(key, ()):
            return key
    if name in _OTHER_NAMES:
        # it exists, but not here: none of those that look alike is meant
        return "one of " + ", ".join(names)
    # a longer name for the same, or a shorter one
    parts = [key for key in names if len(name) > 3 and (name.lower() in key or key in name.lower())]
    near = difflib.get_close_matches(name, names, n=1) or parts[:1]
    return near[0] if near else "one of " + ", ".join(names)
