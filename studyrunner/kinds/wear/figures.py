"""Figures of wear histories."""

from studyrunner.report.contents import AT_THE_END, BANDS, OF_MEASURED, OF_POINTS, OF_RINGS, OF_WEAR, ONE, Entry
from studyrunner.report.figures import pairs, precision, wear
from studyrunner.report.figures.response import draw_loops, draw_responses

_NEEDED = ("response_amplitude",)
_OPEN = "Where the force is zero the pair is open"
_LOOPS = (
    "Tangential force over relative displacement through a period, each about its mean: the area inside is the energy"
    " of friction"
)
_MOTION = "Path of the relative displacement about its mean; a pair that sticks is a dot"
_PRECISION = (
    "Each mark is one setting; a line joins those of a scheme than which no quicker one is as exact; rings: of all."
    " Open marks, in the grey: errors too small against the uncertainty of the reference"
)

FIGURES = (
    *OF_WEAR,
    Entry("frequency_response", "Frequency response of one joint, new and worn", draw_responses, needs=_NEEDED),
    Entry("excitation_frequency", "Frequency of the followed resonance", wear.draw_excitation, caption=BANDS),
    *OF_RINGS,
    *OF_MEASURED,
    Entry("evolution", "Contact that changes with the dissipated energy", wear.draw_evolution, **ONE),
    *OF_POINTS,
    Entry("mean_pressure", "Mean pressure", pairs.draw_pressure, needs=("mean_pressure",), **ONE),
    Entry("fretting_loops", "Fretting loops", draw_loops, "fretting_loops", caption=_LOOPS, **ONE),
    Entry("normal_load", "Normal force through a period", draw_loops, "normal_load", caption=_OPEN, **ONE),
    Entry("pair_motion", "Motion of the pairs in the contact plane", draw_loops, "pair_motion", caption=_MOTION, **ONE),
    *AT_THE_END,
    Entry("precision", "Error against run time", precision.draw_precision, caption=_PRECISION),
)
"""In the order of the page."""
