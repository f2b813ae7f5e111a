"""
Your own array
==============

Heights that are in memory already: from a simulation, a database, another reader.

A map is an array of heights in metres, rows along y and columns along x, with the size of a
pixel. NaN is a point that was not measured.
"""

import matplotlib.pyplot as plt
import numpy as np

import capslip

rng = np.random.default_rng(1)
dy_m = dx_m = 0.1e-3
y_m, x_m = (np.mgrid[:200, :300] + 0.5) * dx_m
height_m = np.full(x_m.shape, -0.5e-6)
for top_m in (0.0, -0.04e-6, -0.08e-6) * 4:  # twelve hills, as spheres of 20 m
    apex_y_m, apex_x_m = rng.uniform(2e-3, 18e-3), rng.uniform(2e-3, 28e-3)
    sphere_m = top_m - ((x_m - apex_x_m) ** 2 + (y_m - apex_y_m) ** 2) / (2 * 20.0)
    height_m = np.maximum(height_m, sphere_m)
height_m += rng.normal(0.0, 2e-9, height_m.shape)
height_m[90:95, 100:120] = np.nan

surface = capslip.HeightMap(height_m, (dy_m, dx_m))
settings = capslip.load_settings(
    overrides=("contact.preload_N=100", "contact.model=interacting", "run.render=false")
)
analysis = capslip.analyze(surface, settings)

# %%
# What is doubtful about it comes with a code that :doc:`the list of warnings <../warnings>`
# explains.

for problem in analysis.problems:
    print(f"{problem.severity:8}{problem.code}: {problem.message}")

# %%
# Every number is at hand as an array.

caps = analysis.caps
for i in np.argsort(-np.nan_to_num(caps.load_N))[:5]:
    print(f"R {caps.radius_m[i]:5.1f} m   bears {caps.load_N[i]:5.1f} N")

figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
analysis.plot.caps(ax=axes)
plt.show()
