"""The law of a joint face per area, from its table of stiffness over closure; needs numpy alone.

`capslip analyze ... --export law` writes this file as `law.py` beside `law.json`. Anywhere else::

    from law import LawTables

    law = LawTables.read("law.json")
    law.shear_Pa(displacement_m=[1e-8, 5e-8], pressure_Pa=2e6)
    law.loss_J_per_m2(displacement_m=5e-8, pressure_Pa=2e6)

Times the area of a patch these are forces and energies. Unloading and reloading follow from the
first loading by Masing's rule: from a reversal on, twice the curve at half the displacement.
"""

import json
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

REACH = 1e-9  # relative, by which a pressure may lie outside of the range
LEAST_STIFFNESS = 1e-300  # stands for none in a logarithm
LEAST_SHARE = 1e-4  # of the withdrawal at total slip; below it the loss falls as its cube
LOADS = np.geomspace(1e-3, 1.0, 120)  # shares of a pressure, between which scans close together


class LawTables:
    """Stiffness, shear stress and loss per area over pressure and displacement.

    The face is a bed of springs that touch one after the other: K(z) is the stiffness of those that
    touch before the closure z, a straight line between the points of the table. Each is a spring
    with a slider under shear, so that all follows from K, with e = delta / (mu kappa)::

        p = P(d) = integral of K from 0 to d,  k_n = K(d),  k_t = K(d) / kappa
        tau = mu [P(d) - P(d - e)],  w = 4 mu^2 kappa integral of s (e - s) K'(d - s) ds

    Where slip has a direction, kappa is one of each pressure, straight in logarithms between two.
    """

    def __init__(self, tables: dict[str, Any]) -> None:
        """Take the tables of `law.json`."""
        z, K = (np.asarray(tables[name], dtype=float) for name in BED)
        self._take_of_joint(tables)
        self._z, self._K, self._slope = z, K, np.diff(K) / np.diff(z)
        self._P = np.append(0.0, np.cumsum(0.5 * (K[1:] + K[:-1]) * np.diff(z)))
        # Integrals of K' z and K' z^2; the springs of the first point touch at zero
        self._first = np.append(0.0, np.cumsum(self._slope * np.diff(z**2) / 2.0))
        self._second = np.append(0.0, np.cumsum(self._slope * np.diff(z**3) / 3.0))

    def _take_of_joint(self, tables: dict[str, Any]) -> None:
        self.friction_coefficient = float(tables["friction_coefficient"])
        self.range_Pa = tuple(float(value) for value in tables["range_Pa"])
        self.kappa = np.asarray(tables["kappa"], dtype=float)  # one, or that of each pressure
        if self.kappa.ndim:
            self._log_p = np.log(np.asarray(tables["pressure_Pa"], dtype=float))

    @staticmethod
    def read(path: str | Path) -> "LawTables":
        """Read `law.json`."""
        return tables_of(json.loads(Path(path).read_text(encoding="utf-8")))

    def closure_m(self, pressure_Pa: ArrayLike) -> np.ndarray:
        """Approach d of the two faces from their first touch."""
        return self._closed(self._checked(pressure_Pa))

    def closures_m(self, pressure_Pa: float) -> np.ndarray:
        """Closures (k,) at `LOADS` times a pressure, as it falls from there."""
        return self._closed(LOADS * self._checked(pressure_Pa))

    def _closed(self, p: np.ndarray) -> np.ndarray:
        i = np.clip(np.searchsorted(self._P, p, side="right") - 1, 0, len(self._slope) - 1)
        K, rest = self._K[i], p - self._P[i]
        root = np.sqrt(np.maximum(K**2 + 2.0 * self._slope[i] * rest, 0.0))
        return np.asarray(self._z[i] + 2.0 * rest / (K + root))

    def normal_stiffness_Pa_per_m(self, pressure_Pa: ArrayLike) -> np.ndarray:
        """Slope dp / dd."""
        return np.asarray(np.interp(self.closure_m(pressure_Pa), self._z, self._K))

    def tangential_stiffness_Pa_per_m(self, pressure_Pa: ArrayLike) -> np.ndarray:
        """Slope d tau / d delta before any slip."""
        return self.normal_stiffness_Pa_per_m(pressure_Pa) / self.kappa_at(pressure_Pa)

    def kappa_at(self, pressure_Pa: ArrayLike) -> np.ndarray:
        """Ratio of normal to tangential stiffness."""
        if not self.kappa.ndim:
            return self.kappa
        return np.asarray(np.exp(np.interp(np.log(pressure_Pa), self._log_p, np.log(self.kappa))))

    def total_slip_displacement_m(self, pressure_Pa: ArrayLike) -> np.ndarray:
        """Displacement from which on everything slips."""
        kappa = self.kappa_at(pressure_Pa)
        return np.asarray(self.friction_coefficient * kappa * self.closure_m(pressure_Pa))

    def shear_Pa(self, displacement_m: ArrayLike, pressure_Pa: ArrayLike) -> np.ndarray:
        """tau(delta, p) on first loading, odd in delta; mu p from total slip on."""
        d, e = self._pressed(displacement_m, pressure_Pa)
        drop_Pa = self._pressure(d) - self._pressure(np.maximum(d - e, 0.0))
        return np.asarray(np.sign(displacement_m) * self.friction_coefficient * drop_Pa)

    def loss_J_per_m2(self, displacement_m: ArrayLike, pressure_Pa: ArrayLike) -> np.ndarray:
        """w(delta, p), lost in one cycle between -delta and delta."""
        d, wanted = self._pressed(displacement_m, pressure_Pa)
        e = np.maximum(wanted, LEAST_SHARE * d)
        kappa = self.kappa_at(pressure_Pa)
        w = 4.0 * self.friction_coefficient**2 * kappa * self._lost(d, e)
        return np.asarray(w * np.minimum(wanted / e, 1.0) ** 3)

    def _lost(self, d: np.ndarray, e: np.ndarray) -> np.ndarray:
        """Integral of s (e - s) K'(d - s)."""
        low = np.maximum(d - e, 0.0)
        touch = np.where(e >= d, self._K[0], 0.0)  # springs that touch at zero, if they slip
        zeroth, first, second = (
            high - below for high, below in zip(self._moments(d), self._moments(low), strict=True)
        )
        return np.asarray(d * (e - d) * (zeroth + touch) + (2.0 * d - e) * first - second)

    def _pressed(
        self, displacement_m: ArrayLike, pressure_Pa: ArrayLike
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return closure and withdrawal."""
        delta, d = np.broadcast_arrays(
            np.abs(np.asarray(displacement_m, dtype=float)), self.closure_m(pressure_Pa)
        )
        return d, delta / (self.friction_coefficient * self.kappa_at(pressure_Pa))

    def _cell(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        i = np.clip(np.searchsorted(self._z, z, side="right") - 1, 0, len(self._slope) - 1)
        return i, self._z[i]

    def _pressure(self, z: np.ndarray) -> np.ndarray:
        i, low = self._cell(z)
        step = z - low
        return np.asarray(self._P[i] + step * (self._K[i] + 0.5 * self._slope[i] * step))

    def _moments(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Integrals of K', K' z and K' z^2 up to z."""
        i, low = self._cell(z)
        k = self._slope[i]
        zeroth = self._K[i] - self._K[0] + k * (z - low)
        first = self._first[i] + k * (z**2 - low**2) / 2.0
        return zeroth, first, self._second[i] + k * (z**3 - low**3) / 3.0

    def _checked(self, pressure_Pa: ArrayLike) -> np.ndarray:
        p, (low, high) = np.asarray(pressure_Pa, dtype=float), self.range_Pa
        if not np.all((p >= low * (1.0 - REACH)) & (p <= high * (1.0 + REACH))):
            raise ValueError(
                f"pressure_Pa: got {p.min():g} to {p.max():g}; expected {low:g} to {high:g} Pa, "
                "which the law holds; analyse the scan at another pressure"
            )
        return p


class BedsByPressure(LawTables):
    """The same where each pressure leaves a bed of its own, known up to the next pressure and on.

    So of a face that yields, which was loaded once to the pressure that is asked for. The closure
    is what the face would open by if it were unloaded, without what yielded.

    Between two pressures closure and stiffness are the means of theirs at equal loads, straight in
    logarithms: a spring that touches there for the first time does so at one load in both. Where
    each interval has beds of its own two ends, (p - 1, 2, n), these belong together as they stand.
    """

    def __init__(self, tables: dict[str, Any]) -> None:
        """Take the tables of `law.json`."""
        self._of_joint = {name: tables[name] for name in OF_JOINT}
        self._take_of_joint(tables)
        self._log_p = np.log(np.asarray(tables["pressure_Pa"], dtype=float))
        z, self._log_K = (np.asarray(tables[name], dtype=float) for name in BED)
        self._log_z, self._log_K = (
            np.log(z[..., 1:]),
            np.log(np.maximum(self._log_K, LEAST_STIFFNESS)),
        )

    def closure_m(self, pressure_Pa: ArrayLike) -> np.ndarray:
        """By how much the faces would open if they were unloaded."""
        return self._each("closure_m", pressure_Pa)

    def closures_m(self, pressure_Pa: float) -> np.ndarray:
        """Closures (k,) at `LOADS` times a pressure, as it falls from there."""
        return self._bed(float(self._checked(pressure_Pa))).closures_m(pressure_Pa)

    def normal_stiffness_Pa_per_m(self, pressure_Pa: ArrayLike) -> np.ndarray:
        """Slope dp / dd where the pressure falls; where it first rises the face is softer."""
        return self._each("normal_stiffness_Pa_per_m", pressure_Pa)

    def shear_Pa(self, displacement_m: ArrayLike, pressure_Pa: ArrayLike) -> np.ndarray:
        """tau(delta, p) on first loading, odd in delta; mu p from total slip on."""
        return self._each("shear_Pa", pressure_Pa, displacement_m)

    def loss_J_per_m2(self, displacement_m: ArrayLike, pressure_Pa: ArrayLike) -> np.ndarray:
        """w(delta, p), lost in one cycle between -delta and delta."""
        return self._each("loss_J_per_m2", pressure_Pa, displacement_m)

    def _each(self, what: str, pressure_Pa: ArrayLike, *displacement_m: ArrayLike) -> np.ndarray:
        """Return what the bed of each pressure gives."""
        p, *delta = np.broadcast_arrays(self._checked(pressure_Pa), *displacement_m)
        found, (each, of) = np.empty(p.shape), np.unique(p, return_inverse=True)
        for i, one in enumerate(each):
            at = of.reshape(p.shape) == i
            found[at] = getattr(self._bed(float(one)), what)(*(x[at] for x in delta), one)
        return found

    def _bed(self, pressure_Pa: float) -> LawTables:
        i, x = _cell(self._log_p, np.log(pressure_Pa))
        ends = (of[i] if of.ndim == 3 else of[i : i + 2] for of in (self._log_z, self._log_K))
        z, K = (np.exp((1.0 - x) * low + x * high) for low, high in ends)
        own = {"kappa": self.kappa_at(pressure_Pa), BED[0]: np.append(0.0, z), BED[1]: K}
        return LawTables(self._of_joint | own)


class MeanOfScans(LawTables):
    """The mean over the scans of a joint, each of which bears p and moves by delta.

    They close together by dd = dp / k_n, with the mean k_n. The displacement at total slip is that
    of the scan that lets go last.
    """

    def __init__(self, tables: dict[str, Any]) -> None:
        """Take the tables of `law.json`."""
        self._take_of_joint(tables)
        of_joint = {name: tables[name] for name in OF_JOINT}
        self._scans = [tables_of(of_joint | one) for one in tables["of_scans"]]
        self._share = np.array([one["share"] for one in tables["of_scans"]], dtype=float)

    def closure_m(self, pressure_Pa: ArrayLike) -> np.ndarray:
        """Approach d of the two faces from their first touch, the integral of dp / k_n."""
        p = self._checked(pressure_Pa)
        return np.reshape([self.closures_m(one)[-1] for one in p.ravel().tolist()], p.shape)

    def closures_m(self, pressure_Pa: float) -> np.ndarray:
        """Closures (k,) at `LOADS` times a pressure, as it falls from there."""
        each = [one.closures_m(pressure_Pa) for one in self._scans]
        return closures_together_m(each, self._share)

    def normal_stiffness_Pa_per_m(self, pressure_Pa: ArrayLike) -> np.ndarray:
        """Slope dp / dd."""
        return self._mean([one.normal_stiffness_Pa_per_m(pressure_Pa) for one in self._scans])

    def tangential_stiffness_Pa_per_m(self, pressure_Pa: ArrayLike) -> np.ndarray:
        """Slope d tau / d delta before any slip."""
        return self._mean([one.tangential_stiffness_Pa_per_m(pressure_Pa) for one in self._scans])

    def total_slip_displacement_m(self, pressure_Pa: ArrayLike) -> np.ndarray:
        """Displacement from which on everything slips."""
        return np.max([one.total_slip_displacement_m(pressure_Pa) for one in self._scans], axis=0)

    def shear_Pa(self, displacement_m: ArrayLike, pressure_Pa: ArrayLike) -> np.ndarray:
        """tau(delta, p) on first loading, odd in delta; mu p from total slip on."""
        return self._mean([one.shear_Pa(displacement_m, pressure_Pa) for one in self._scans])

    def loss_J_per_m2(self, displacement_m: ArrayLike, pressure_Pa: ArrayLike) -> np.ndarray:
        """w(delta, p), lost in one cycle between -delta and delta."""
        return self._mean([one.loss_J_per_m2(displacement_m, pressure_Pa) for one in self._scans])

    def _mean(self, values: list[np.ndarray]) -> np.ndarray:
        return np.asarray(np.tensordot(self._share, values, 1))


def tables_of(tables: dict[str, Any]) -> LawTables:
    """Return the tables of `law.json`: of several scans, of one, or of one that yields."""
    if "of_scans" in tables:
        return MeanOfScans(tables)
    return BedsByPressure(tables) if np.ndim(tables[BED[0]]) > 1 else LawTables(tables)


def closures_together_m(closure_m: ArrayLike, share: ArrayLike) -> np.ndarray:
    """Return closures (k,) of patches that bear one growing pressure, of theirs, (n, k).

    From one pressure to the next the stiffness dp / dd is the mean of theirs.
    """
    steps_m = np.diff(closure_m, prepend=0.0)
    return np.cumsum(1.0 / (np.asarray(share) @ (1.0 / steps_m)))


def _cell(known: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the interval of each value and the share of it that lies below."""
    i = np.clip(np.searchsorted(known, at, side="right") - 1, 0, len(known) - 2)
    return i, np.clip((at - known[i]) / (known[i + 1] - known[i]), 0.0, 1.0)


OF_JOINT = ("friction_coefficient", "kappa", "range_Pa")
BED = ("bed_closure_m", "bed_stiffness_Pa_per_m")
ROWS = (
    *("pressure_Pa", "closure_m", "normal_stiffness_Pa_per_m"),
    *("displacement_m", "shear_Pa", "loss_J_per_m2"),
)
