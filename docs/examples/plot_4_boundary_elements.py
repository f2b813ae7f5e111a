"""
Boundary elements against caps
==============================

Spheres, or the measured map itself? The ladder of contact models, on one face.

Boundary elements press every pixel of the map. They need no caps and no fit, and more time. The
cheaper models are held against them.
"""

import matplotlib.pyplot as plt
import numpy as np

import capslip
from capslip.analysis import analyze_once

surface = capslip.load_surface("sample_surfaces/paper_face_a.h5")
shares = np.linspace(0.02, 0.95, 40)
curves = {}
for model in ("families", "caps", "mean_field", "interacting", "boundary_elements"):
    settings = capslip.load_settings(
        overrides=(
            f"contact.model={model}",
            "contact.preload_N=460",
            "conditioning.resample_to=[120,180]",
        )
    )
    analysis = analyze_once(surface, settings)
    slip = analysis.slip
    curves[model] = slip.energy_at_force_J(shares * slip.total_slip_force_N)
    print(f"{model:18}{slip.tangential_stiffness_N_per_m / 1e9:6.2f} GN/m")

# %%
# The energy lost per cycle, over that of boundary elements. Near gross slip all must agree about
# the force, and they differ in how the load is shared between the caps.

figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
for model, energy_J in curves.items():
    axes.plot(shares, energy_J / curves["boundary_elements"], label=model.replace("_", " "))
axes.set(xlabel="force over that of gross slip", ylabel="energy over boundary elements")
axes.legend()
plt.show()

# %%
# Which one to take when is measured on many faces: :doc:`../speed-accuracy`.
