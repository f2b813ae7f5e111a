"""
A batch with Dask
=================

Many scans on a cluster; here the cluster is a thread of this process.

The batch is a loop over any executor. With a scheduler of Dask it is that of the cluster.
"""

import csv
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from distributed import LocalCluster

import capslip
from capslip.batch import Options, run_batch
from capslip.studies.faces.scenes import PAPER
from capslip.studies.faces.synthetic import Scene, synthetic_surface
from capslip.surface.readers.hdf5 import write_hdf5

folder = Path(tempfile.mkdtemp())
(folder / "scans").mkdir()
for i in range(6):
    scene = Scene((100, 150), (4e-4, 4e-4), seed=i, families=PAPER, noise_rms_m=2e-9)
    write_hdf5(synthetic_surface(scene)[0], folder / "scans" / f"face_{i}.h5")

settings = capslip.load_settings(
    overrides=("contact.model=interacting", "run.figures=false", "run.render=false")
)
with LocalCluster(1, processes=False, dashboard_address="127.0.0.1:0") as here:
    options = Options(scheduler=here.scheduler_address)
    run_batch([str(folder / "scans")], folder / "out", settings, print, options=options)

# %%
# One row a scan, the same numbers as ``batch.csv``.

with (folder / "out" / "batch.csv").open() as file:
    table = list(csv.DictReader(file))
stiffness = np.array([float(row["tangential_stiffness_N_per_m"]) for row in table])

figure, axes = plt.subplots(figsize=(7, 3.5), layout="constrained")
axes.bar([row["scan"] for row in table], stiffness / 1e9)
axes.set(ylabel="stiffness [GN/m]")
plt.show()
