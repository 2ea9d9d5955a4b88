"""What a film leaves open about its camera: standard errors that every length and angle inherits.

None of them leaves a trace in a residual, so none can be measured here: a calibrated camera or a ruler would narrow
them.
"""

import math

RELATIVE_SCALE_STD = 0.005
"""One tag's scale against the other's: two prints, two depths; a move of the tool shows it much better than this."""

VERTICAL_SCALE_STD = 0.002
"""Foreshortening along z: a camera pitched by 3.6°."""

TILT_STD_RAD = math.radians(0.5)
"""The picture's vertical against gravity: a camera set up by eye or by a plumb line in the picture."""
