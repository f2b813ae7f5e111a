"""The apex from a quadric through the top of the hill, the radius from the volume below it.

Noise does not lift that apex. The sphere has the volume of the hill within the depth of the fit:
Eq. 18 averaged over all cuts down to there.
"""

from capslip.caps.fitting import Fit
from capslip.caps.spheres import spheres_by_volume

FIT = Fit(
    spheres=spheres_by_volume,
    label="apex of the crown, volume below it",
    colour="#E69F00",
    marker="^",
)
