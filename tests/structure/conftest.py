"""A slip curve in closed form: spherical contacts side by side, each with its own limit."""

import numpy as np
import pytest


class Spheres:
    """Eqs. 4-16 for groups of (mu N of the group, displacement at total slip), q-form of Eq. 8."""

    def __init__(self, *groups):
        self.slip_force_N, self.limit_m = np.array(groups, dtype=float).T
        self.total_slip_force_N = self.slip_force_N.sum()
        self.total_slip_displacement_m = self.limit_m.max()

    def _stuck(self, displacement_m):
        s = np.minimum(np.asarray(displacement_m)[..., None] / self.limit_m, 1.0)
        q = np.sqrt(1 - s)
        return q, s / (1 + q)

    def force_N(self, displacement_m):
        q, p = self._stuck(displacement_m)
        return p * (1 + q + q**2) @ self.slip_force_N

    def stiffness_N_per_m(self, displacement_m):
        return self._stuck(displacement_m)[0] @ (1.5 * self.slip_force_N / self.limit_m)

    def energy_J(self, displacement_m):
        q, p = self._stuck(displacement_m)
        beyond_m = np.maximum(np.asarray(displacement_m)[..., None] - self.limit_m, 0.0)
        partial = p**3 * (1 + 3 * q + q**2) * self.limit_m
        return (0.8 * partial + 4 * beyond_m) @ self.slip_force_N

    def displacement_m(self, force_N):
        force_N = np.asarray(force_N)
        displacement_m = force_N / self.stiffness_N_per_m(0.0)
        for _ in range(60):  # Newton rises to the root of a concave curve
            rest_N = force_N - self.force_N(displacement_m)
            slope = np.maximum(self.stiffness_N_per_m(displacement_m), 1e-300)
            step_m = np.where(rest_N > 0, rest_N / slope, 0.0)
            displacement_m = np.minimum(displacement_m + step_m, self.total_slip_displacement_m)
        sliding = force_N >= self.total_slip_force_N
        return np.where(sliding, self.total_slip_displacement_m, displacement_m)

    def energy_at_force_J(self, force_N):
        return self.energy_J(self.displacement_m(force_N))


class OneSlider:
    """A plane interface on an elastic layer: nothing slips before everything does."""

    total_slip_force_N = 90.0
    total_slip_displacement_m = 3e-8
    stiffness = 3e9

    def force_N(self, displacement_m):
        return np.minimum(self.stiffness * np.asarray(displacement_m), self.total_slip_force_N)

    def stiffness_N_per_m(self, displacement_m):
        return np.full(np.shape(displacement_m), self.stiffness)

    def displacement_m(self, force_N):
        return np.asarray(force_N) / self.stiffness

    def energy_J(self, displacement_m):
        beyond_m = np.asarray(displacement_m) - self.total_slip_displacement_m
        return 4 * self.total_slip_force_N * np.maximum(beyond_m, 0.0)

    def energy_at_force_J(self, force_N):
        return np.zeros(np.shape(force_N))


# The paper's reference joint, in its nearest round numbers, and two others.
SCENES = {
    "one": [(92.0, 6e-8)],
    "two": [(89.35, 6.071e-8), (2.725, 2.429e-9)],
    "loose": [(60.0, 6e-8), (30.0, 4e-9)],
    "close": [(50.0, 6e-8), (50.0, 5.4e-8)],
    "many": [(d**1.5, 1e-8 * d) for d in np.linspace(0.03, 1.0, 40)],
}


@pytest.fixture(params=SCENES)
def slip(request):
    return Spheres(*SCENES[request.param])


@pytest.fixture
def spheres():
    return Spheres


@pytest.fixture
def one_slider():
    return OneSlider()
