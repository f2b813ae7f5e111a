"""
A joint under a pressure map
============================

Two bolts press the middle more than the ends. What does that do to the damping?

The pressures of a finite-element model come as a CSV, one line an element, with the columns
``pressure_Pa`` and ``area_m2``. The scan stands for the face of every element.
"""

import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import capslip

x_m = np.linspace(-0.06, 0.06, 24)
area_m2 = np.full(x_m.shape, 0.12 / 24 * 0.04)
bolted_Pa = 0.5e6 * (
    np.exp(-(((x_m - 0.03) / 0.015) ** 2)) + np.exp(-(((x_m + 0.03) / 0.015) ** 2))
)
bolted_Pa += 0.02e6
even_Pa = np.full(x_m.shape, bolted_Pa.mean())

surface = capslip.load_surface("sample_surfaces/paper_face_a.h5")
found = {}
with tempfile.TemporaryDirectory() as folder:
    for name, pressure_Pa in (("bolts", bolted_Pa), ("even", even_Pa)):
        file = Path(folder) / f"{name}.csv"
        rows = np.column_stack([pressure_Pa, area_m2])
        np.savetxt(file, rows, delimiter=",", header="pressure_Pa,area_m2", comments="")
        settings = capslip.load_settings(
            overrides=(
                f"joint.pressure_map={file}",
                "conditioning.resample_to=[200,300]",
                "contact.model=interacting",
                "material.friction_coefficient=0.15",
            )
        )
        found[name] = capslip.analyze(surface, settings)

# %%
# The load is the same, and so is the force of gross slip. But where the pressure is small, slip
# begins early: the joint under bolts loses more, at all but the greatest forces.

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.8), layout="constrained")
for name, pressure_Pa in (("bolts", bolted_Pa), ("even", even_Pa)):
    left.plot(x_m * 1e3, pressure_Pa / 1e6, label=name)
left.set(xlabel="place along the joint [mm]", ylabel="pressure [MPa]")
left.legend()
shares = np.geomspace(0.02, 0.95, 60)
bolts_J, even_J = (
    one.slip.energy_at_force_J(shares * one.slip.total_slip_force_N) for one in found.values()
)
right.semilogx(shares, bolts_J / even_J)
right.set(xlabel="force over that of gross slip", ylabel="energy lost, bolts over even")
plt.show()
