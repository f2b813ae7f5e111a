"""What lies between the points of a face that was laid on other points: nobody measured it."""

import math
from collections.abc import Iterable
from dataclasses import dataclass

# Rms that a quintic spline misses, over d^3 / b^2 with the rms d of what it differs from a cubic
# one and b of what that differs from straight lines: on sums of waves of 3 to 8 points and on rough
# faces with a Hurst exponent of 0.5 to 1, which differ in it by a factor of thousand, 0.7 to 2.3
MISSED = 118.0
MOST = 2.0  # of b: on these rough faces 1.6 to 3.6 times it is missed, of noise as much is none


@dataclass(frozen=True)
class Between:
    """How far splines of growing degree differ between the points of a face."""

    apart_m: float  # the points, the wider way
    bends_m: float  # rms of what a cubic spline differs from straight lines
    finer_m: float  # rms of what a quintic spline differs from the cubic one
    of_noise: tuple[float, float]  # the same two of white noise of rms 1
    pixels: tuple[float, float] = (1.0, 1.0)  # between its points along (y, x) of the others
    scans: float = 1.0  # of which it has the noise

    def missed_m(self, noise_m: float | None = None) -> float:
        """Return the rms of what a face may be off between its points, where a spline goes.

        Differences of splines fall from one degree to the next, the more the less of a face is as
        short as its points lie apart: so much is there, and about as much is missed beyond.

        Parameters
        ----------
        noise_m : float, optional
            White noise of a scan, which is known by itself; its part of both counts for nothing.

        Examples
        --------
        >>> smooth = Between(4e-5, 1e-8, 5e-10, (0.3, 0.1))
        >>> rough = Between(4e-5, 1e-8, 2.6e-9, (0.3, 0.1))
        >>> [f"{one.missed_m():.1e}" for one in (smooth, rough)]
        ['1.5e-10', '2.0e-08']
        """
        pairs = zip((self.bends_m, self.finer_m), self.of_noise, strict=True)
        noise_m2 = self.scans * (noise_m or 0.0) ** 2
        own_m2 = [one_m**2 - noise_m2 * of**2 for one_m, of in pairs]
        bends_m, finer_m = (math.sqrt(max(one, 0.0)) for one in own_m2)
        if finer_m == 0.0:
            return 0.0
        steep = finer_m / max(bends_m, finer_m)
        return min(MISSED * finer_m * steep**2, MOST * bends_m)


def missed_of_all_m(faces: Iterable[Between], noise_m: float | None) -> float:
    """Return the rms that faces of one sum miss, each with the noise of one scan."""
    return math.hypot(*(one.missed_m(noise_m) for one in faces))
