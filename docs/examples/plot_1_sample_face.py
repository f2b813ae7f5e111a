"""
A sample face
=============

From the file to the loss factor, with a picture of each step.
"""

import matplotlib.pyplot as plt

import capslip

surface = capslip.load_surface("sample_surfaces/paper_face_a.h5")
settings = capslip.load_settings(overrides=("contact.preload_N=460",))
analysis = capslip.analyze(surface, settings)
print(analysis)

# %%
# The height map, levelled, and the caps that were found on it. The sample holds two high hills
# (G) and nine lower ones (P); all eleven are there.

figure, axes = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
analysis.plot.height_map(ax=axes[0])
analysis.plot.caps(ax=axes[1])

# %%
# Their radii are 23.8 m and 26.7 m in the truth of the sample.

families = analysis.summary()["families"]
print(families["m"], families["n"], f"{families['h_m'] * 1e9:.0f} nm")

# %%
# What the joint does under a vibrating shear force: the cycle, and the loss factor of the
# structure.

analysis.plot.loop()
analysis.plot.loss_factor()
plt.show()
