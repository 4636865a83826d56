"""The variables of a result file of nonlinear modes. The axes of such a file end with modal_amplitude and cycle."""

from __future__ import annotations

from dataclasses import replace

from studyrunner.variables import ASKED, KEPT, Variable

OF_MODES = {
    "natural_frequency": Variable(
        (), "Hz", "natural frequency of the nonlinear mode", comment="NaN where no state was found, see outcome."
    ),
    "natural_frequency_error": Variable(
        (),
        "Hz",
        "estimated error of the natural frequency",
        comment="Harmonics, samples and steps of the amplitude; inf where it is unknown.",
    ),
    "damping_ratio": Variable(
        (),
        "1",
        "damping ratio of the nonlinear mode",
        comment="Friction and damping of the structure together; positive where the vibration decays.",
    ),
    "damping_ratio_error": Variable(
        (),
        "1",
        "estimated error of the damping ratio",
        comment="Absolute, as the damping ratio itself; inf where it is unknown.",
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
    "slip_fraction": Variable(
        ("contact",),
        "1",
        "fraction of the period in which the pair slips",
        comment="0 where the pair sticks for the whole period.",
    ),
    "open_fraction": replace(ASKED["open_fraction"], dimensions=("contact",)),
    "harmonics_used": replace(ASKED["harmonics_used"], dimensions=(), comment="0 where no state was found."),
    "samples_used": replace(ASKED["samples_used"], dimensions=(), comment="0 where no state was found."),
}
"""Those that `outputs.variables` asks for in a study of nonlinear modes, in the order of the file."""

OF_A_MODE_POINT = {
    "outcome": KEPT["outcome"],
    "newton_iterations": replace(
        KEPT["newton_iterations"],
        long_name="Newton iterations of the point, the way to it included",
        comment="With the whole way from the joint at rest, as for this point alone.",
    ),
    "run_time": replace(
        KEPT["run_time"],
        long_name="CPU time of the computing thread, compiling left out",
        comment="With the way from the point before; differs from run to run.",
    ),
    "message": replace(KEPT["message"], comment="Up to which amplitude the mode exists; how well a point is known."),
}
"""Those that every result of nonlinear modes holds."""
