"""The sphere that loads like the hill where the preload compresses it.

Apex and radius as by volume, but fitted again down to half of the compression a^2 / R that contact
found for each cap; and the edge of what was measured is taken as that of the face: a cap it cuts
gets the radius of the sphere that loads like what is there.
"""

from capslip.caps.fitting import Fit
from capslip.caps.spheres import spheres_by_volume

FIT = Fit(
    spheres=spheres_by_volume,
    label="volume where contact compresses it",
    colour="#0072B2",
    marker="o",
    compression_share=0.5,
    edge_of_face=True,
)
