"""A damping curve as a test rig would give it, but synthetic: to try `capslip compare` with."""

from pathlib import Path

import numpy as np

from capslip.analysis import analyze_once
from capslip.errors import ContactError
from capslip.settings import load_settings
from capslip.surface.readers import load_surface

FACE, FRICTION, PRELOAD_N = "paper_face_a", 0.25, 400.0
SCATTER = 0.03  # standard deviation of the logarithm of each value
MATERIAL_LOSS = 4e-4  # loss factor of the beam without joints
POINTS, SEED = 24, 100
BEGIN = 0.02  # of the amplitude at gross slip; the end is just below it
# Beside the scans, and not among them: a batch of the folder takes every table for a map
ASSEMBLY, MONOLITHIC = "damping/measured_assembly.csv", "damping/measured_monolithic.csv"


def write_curves(folder: Path) -> str:
    """Write the curve of a beam with joints and of one without; return what the README says.

    The joints are those of the sample face in the folder, as the program sees them. Amplitude and
    loss factor are those of the whole, as a sensor sees them and `capslip compare` reads them.
    """
    truth = (f"material.friction_coefficient={FRICTION}", f"contact.preload_N={PRELOAD_N}")
    analysis = analyze_once(load_surface(folder / f"{FACE}.h5"), load_settings(overrides=truth))
    damping = analysis.damping
    if damping is None:
        raise ContactError(f"{FACE}: carries no {PRELOAD_N:g} N; there is no damping curve")
    defined = np.isfinite(damping.loss_factor)
    total_m = damping.total_amplitude_m[defined]
    amplitude_m = np.geomspace(BEGIN, 1.0, POINTS) * 0.9 * total_m[-1]
    joints = np.interp(np.log(amplitude_m), np.log(total_m), damping.total_loss_factor[defined])
    noise = np.random.default_rng(SEED).normal(0.0, SCATTER, (2, POINTS))
    assembly, monolithic = np.exp(noise) * (joints + MATERIAL_LOSS, np.full(POINTS, MATERIAL_LOSS))
    about = (
        f"SYNTHETIC, not measured: computed from {FACE}.h5 with friction {FRICTION:g} at "
        f"{PRELOAD_N:g} N and the demonstration beam, {100 * SCATTER:g} % scatter"
    )
    (folder / ASSEMBLY).parent.mkdir(exist_ok=True)
    for name, loss_factor in ((ASSEMBLY, assembly), (MONOLITHIC, monolithic)):
        of = "with" if name == ASSEMBLY else "without"
        rows = (f"{v * 1e9:.4g},{eta:.3g}" for v, eta in zip(amplitude_m, loss_factor, strict=True))
        text = "\n".join((f"# {about}; beam {of} joints", "amplitude_nm,loss_factor", *rows, ""))
        (folder / name).write_text(text, encoding="utf-8")
    return f"""## {ASSEMBLY}, {MONOLITHIC}

Damping curves to try `capslip compare` with.
{about}.
The beam without joints has a loss factor of {MATERIAL_LOSS:g}.

    capslip analyze sample_surfaces/{FACE}.h5 --out results/{FACE}
    capslip compare results/{FACE} --assembly sample_surfaces/{ASSEMBLY} \\
        --monolithic sample_surfaces/{MONOLITHIC} --identify
"""
