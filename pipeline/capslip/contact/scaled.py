"""A normal curve whose loads and lengths are those of another one by factors."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from capslip.contact.curve import NormalCurve


def with_ratio(curve: NormalCurve, ratio: float) -> NormalCurve:
    """Return the curve of a joint with a kappa of its own, from that of a part of it.

    At one displacement delta = mu kappa e a part of another kappa is withdrawn by e over the ratio
    of that to the kappa of the joint: so its lengths and losses count the ratio.
    """
    if ratio == 1.0:
        return curve
    return ScaledCurve(curve, 1.0, approach=ratio, withdrawal=ratio, loss=ratio)


@dataclass(frozen=True, eq=False)
class ScaledCurve:
    """Another curve with factors: many equal scans side by side, or a face under another load."""

    curve: NormalCurve
    factor: float  # on every load, and on the loss where nothing else is given
    approach: float = 1.0
    withdrawal: float = 1.0
    loss: float | None = None

    @property
    def model(self) -> str:
        """Name of the model."""
        return self.curve.model

    @property
    def touch_m(self) -> np.ndarray:
        """Approach of first touch."""
        return self.approach * self.curve.touch_m

    @property
    def compliance_m_per_N(self) -> Any:
        """Compliance of the springs in series."""
        return self.curve.compliance_m_per_N * (self.withdrawal / self.factor)

    def load_N(self, approach_m: ArrayLike) -> np.ndarray:
        """N(d)."""
        return self.factor * self.curve.load_N(self._level_m(approach_m))

    def approach_m(self, load_N: ArrayLike) -> np.ndarray:
        """d(N)."""
        return self.approach * self.curve.approach_m(self._load_N(load_N))

    def stiffness_N_per_m(self, approach_m: ArrayLike, withdrawal_m: ArrayLike = 0.0) -> np.ndarray:
        """N'(d - e)."""
        at = self._level_m(approach_m), self._withdrawn_m(withdrawal_m)
        return self.factor / self.withdrawal * self.curve.stiffness_N_per_m(*at)

    def load_drop_N(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """N(d) - N(d - e)."""
        at = self._level_m(approach_m), self._withdrawn_m(withdrawal_m)
        return self.factor * self.curve.load_drop_N(*at)

    def withdrawal_m(self, approach_m: ArrayLike, load_drop_N: ArrayLike) -> np.ndarray:
        """Withdrawal for a load drop."""
        at = self._level_m(approach_m), self._load_N(load_drop_N)
        return self.withdrawal * self.curve.withdrawal_m(*at)

    def loss_integral_J(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """4 * integral of s (e - s) N''(d - s)."""
        at = self._level_m(approach_m), self._withdrawn_m(withdrawal_m)
        return self._loss * self.curve.loss_integral_J(*at)

    def loss_integral_at_drop_J(self, approach_m: ArrayLike, load_drop_N: ArrayLike) -> np.ndarray:
        """Return the same at given load drop."""
        at = self._level_m(approach_m), self._load_N(load_drop_N)
        return self._loss * self.curve.loss_integral_at_drop_J(*at)

    def lift_off_m(self, approach_m: ArrayLike) -> np.ndarray:
        """Withdrawal at which each row of the other curve loses its load."""
        return self.withdrawal * self.curve.lift_off_m(self._level_m(approach_m))

    def lifted(self, approach_m: ArrayLike, withdrawal_m: ArrayLike) -> np.ndarray:
        """Whether each row of the other curve had a load and has lost it."""
        return self.curve.lifted(self._level_m(approach_m), self._withdrawn_m(withdrawal_m))

    @property
    def _loss(self) -> float:
        return self.factor if self.loss is None else self.loss

    def _load_N(self, load_N: ArrayLike) -> np.ndarray:
        return np.asarray(load_N, dtype=float) / self.factor

    def _level_m(self, approach_m: ArrayLike) -> np.ndarray:
        return np.asarray(approach_m, dtype=float) / self.approach

    def _withdrawn_m(self, withdrawal_m: ArrayLike) -> np.ndarray:
        return np.asarray(withdrawal_m, dtype=float) / self.withdrawal
