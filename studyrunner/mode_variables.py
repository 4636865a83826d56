"""The variables of a result file of nonlinear modes. The axes of such a file end with modal_amplitude and cycle."""

from __future__ import annotations

from dataclasses import replace

from studyrunner.variables import ASKED, KEPT, Variable

OF_MODES = {
    "natural_frequency": Variable((), "Hz", "natural frequency of the nonlinear mode"),
    "natural_frequency_error": Variable(
        (), "Hz", "estimated error of the natural frequency", comment="Absolute; inf where it is unknown."
    ),
    "damping_ratio": Variable(
        (), "1", "damping ratio of the nonlinear mode", comment="Of friction and structure together, decay positive."
    ),
    "damping_ratio_error": Variable(
        (), "1", "estimated error of the damping ratio", comment="Absolute; inf where it is unknown."
    ),
    "response_amplitude": Variable(
        ("response",),
        "m",
        "amplitude of the first harmonic of the response in the mode",
        comment="At the modal amplitude; over modal_amplitude: shape of the mode, normalised with the mass.",
    ),
    "response_phase": Variable(
        ("response",),
        "rad",
        "phase of the first harmonic of the response in the mode",
        comment="To the vibration of the linear mode, of which the largest component has the phase 0.",
    ),
    "slip_fraction": Variable(("contact",), "1", "fraction of the period in which the pair slips"),
    "open_fraction": replace(ASKED["open_fraction"], dimensions=("contact",)),
    "harmonics_used": replace(ASKED["harmonics_used"], dimensions=()),
    "samples_used": replace(ASKED["samples_used"], dimensions=()),
}
"""Those that `outputs.variables` asks for in a study of nonlinear modes, in the order of the file."""

OF_A_MODE_POINT = {
    "outcome": KEPT["outcome"],
    "newton_iterations": replace(KEPT["newton_iterations"], comment="With the whole way from the joint at rest."),
    "run_time": replace(KEPT["run_time"], comment="With the way from the point before; differs from run to run."),
    "message": KEPT["message"],
}
"""Those that every result of nonlinear modes holds."""
