"""
A law for a harmonic-balance code
=================================

A mass on a joint, driven near resonance. The joint is a few sliders whose sum follows the slip
curve; one harmonic is balanced.
"""

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import brentq

import capslip
from capslip.structure.jenkins import jenkins

settings = capslip.load_settings(
    overrides=(
        "contact.preload_N=460",
        "contact.model=interacting",
        "conditioning.resample_to=[200,300]",
    )
)
analysis = capslip.analyze(capslip.load_surface("sample_surfaces/paper_face_a.h5"), settings)
elements = jenkins(analysis.slip)
print(
    f"{elements.stiffness_N_per_m.size} sliders, energy within {100 * elements.energy_error:.1f} %"
)

# %%
# Over one cycle of amplitude delta the first harmonic of the force is a stiffness and a damping.
# The secant T/delta stands for the first, the energy W / (pi delta^2) for the second. A code with
# more harmonics follows each slider in time instead.

mass_kg, outside_N = 20.0, np.array([0.02, 0.1, 0.3, 0.6])
k_N_per_m = elements.stiffness_N_per_m.sum()
resonance = np.sqrt(k_N_per_m / mass_kg)


def amplitude_m(force_N, omega):
    """Return the amplitude at which the driven mass is in balance."""

    def missing(delta_m):
        stiff = elements.force_N(delta_m) / delta_m - mass_kg * omega**2
        loss = elements.energy_J(delta_m) / (np.pi * delta_m**2) + 1e-3 * k_N_per_m
        return float(np.hypot(stiff, loss) * delta_m - force_N)

    return brentq(missing, 1e-13, 1e-6)


# %%
# The resonance moves down and broadens as the joint slips: stiffness falls, damping grows.

figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
ratio = np.linspace(0.9, 1.05, 151)
for force_N in outside_N:
    response_m = np.array([amplitude_m(force_N, r * resonance) for r in ratio])
    axes.plot(ratio, response_m / force_N * k_N_per_m, label=f"{force_N:g} N")
axes.set(xlabel="frequency over that of the stuck joint", ylabel="amplitude times k over force")
axes.legend(title="driving force")
plt.show()

# %%
# For tmdsimpy and pyHarm, ``capslip analyze --export law`` writes these sliders ready to use:
# :doc:`../guides/finite-elements`.
