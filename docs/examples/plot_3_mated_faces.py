"""
Two mated faces
===============

Both faces of a joint, added to one surface against a plane; and the paper's way, which counts the
caps of both.
"""

import matplotlib.pyplot as plt
import numpy as np

import capslip

# A quarter of the points along each axis is enough here.
thin = ("conditioning.resample_to=[200,300]", "contact.preload_N=460", "contact.model=interacting")
first, second = (
    capslip.load_surface(f"sample_surfaces/paper_face_{name}.h5") for name in ("a", "b")
)
found = {
    way: capslip.analyze(
        first, capslip.load_settings(overrides=(*thin, f"mating.way={way}")), mate=second
    )
    for way in ("composite", "together")
}
for way, analysis in found.items():
    print(f"{way:10}{analysis.slip.tangential_stiffness_N_per_m / 1e9:.2f} GN/m")

# %%
# The sum has fewer places that are high on both sides: it is softer, and its slip grows sooner.

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained")
found["composite"].plot.height_map(ax=left)
for way, analysis in found.items():
    force_N = np.linspace(0.0, 0.98, 100) * analysis.slip.total_slip_force_N
    right.plot(analysis.slip.displacement_m(force_N) * 1e9, force_N, label=way)
right.set(xlabel="slip [nm]", ylabel="force [N]")
right.legend()
plt.show()
