"""The sample surfaces: synthetic faces of known content, written again by `make samples`."""

import json
import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from capslip.errors import OutputError
from capslip.studies.faces.curve import write_curves
from capslip.studies.faces.scenes import PAPER
from capslip.studies.faces.synthetic import Cap, CapFamily, Scene, Truth, synthetic_surface
from capslip.studies.page import table
from capslip.surface.heightmap import HeightMap
from capslip.surface.readers.hdf5 import write_hdf5

STEP_M = 0.125e-9  # heights are rounded to eighths of a nanometre: exact in binary, packs well
DIGITS = 10  # of the numbers of the truth: the sums of linear algebra differ beyond, by processor
RADIUS_G_M, RADIUS_P_M, H_M = PAPER[0].radius_m, PAPER[1].radius_m, PAPER[1].below_m


@dataclass(frozen=True)
class Sample:
    """A scene and what it is there for."""

    name: str
    about: str
    scene: Scene


def write_samples(folder: str | Path) -> None:
    """Write every sample surface (HDF5), its truth (JSON), damping curves (CSV) and a README.

    The same bytes every time.

    Parameters
    ----------
    folder : path
        Made where absent; files of the same names are replaced.

    Raises
    ------
    OutputError
        If the folder cannot be made or written.
    """
    folder = Path(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        sections = [_write(sample, folder) for sample in samples()]
        sections.append(write_curves(folder))
        (folder / "README.md").write_text("\n".join([_head(), *sections]), encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written ({error}); choose another") from error


def samples() -> tuple[Sample, ...]:
    """Return the scenes of the sample surfaces."""
    paper = Scene(
        floor_m=0.4e-6,
        gap_m=1.5e-3,
        waviness_rms_m=0.04e-6,
        waviness_length_m=4e-3,
        roughness_rms_m=1.5e-9,
        roughness_length_m=0.15e-3,
        noise_rms_m=1.5e-9,
        tilt=(2e-5, -3e-5),
        non_measured_fraction=0.002,
        n_patches=3,
        patch_radius_m=0.4e-3,
    )
    return (
        Sample(
            "paper_face_a",
            "One face of a joint like the paper's. With face b it carries 5 G-caps and 18 P-caps.",
            replace(paper, seed=16, families=_families(2, 9)),
        ),
        Sample(
            "paper_face_b",
            "The other face.",
            replace(paper, seed=15, families=_families(3, 9)),
        ),
        Sample(
            "harder_face",
            "What real scans do: pixels that are not square, a bow besides the tilt, spikes, "
            "more noise, hills that touch (caps 1-2 and 3-4 of the list `X`) and hills that the "
            "edge cuts (caps 5 and 6). Remove a quadratic form; a plane is not enough.",
            replace(
                paper,
                shape=(640, 1000),
                pixel_size_m=(62.5e-6, 60e-6),
                seed=13,
                families=_families(1, 4),
                caps=(
                    Cap(14e-3, 9e-3, RADIUS_P_M, 0.12e-6, "X"),
                    Cap(18e-3, 10e-3, RADIUS_P_M, 0.10e-6, "X"),
                    Cap(44e-3, 30e-3, RADIUS_G_M, 0.20e-6, "X"),
                    Cap(49e-3, 31e-3, RADIUS_P_M, 0.11e-6, "X"),
                    Cap(0.5e-3, 25e-3, RADIUS_P_M, 0.12e-6, "X"),
                    Cap(35e-3, 39.5e-3, RADIUS_G_M, 0.15e-6, "X"),
                ),
                bow_m=(1.5e-6, -1.0e-6),
                n_spikes=40,
                spike_m=0.4e-6,
                noise_rms_m=4e-9,
                non_measured_fraction=0.01,
                n_patches=6,
                patch_radius_m=0.6e-3,
            ),
        ),
    )


def _families(n_g: int, n_p: int) -> tuple[CapFamily, CapFamily]:
    return replace(PAPER[0], count=n_g), replace(PAPER[1], count=n_p)


def _write(sample: Sample, folder: Path) -> str:
    surface, truth = synthetic_surface(sample.scene, sample.name)
    rounded = replace(surface, height_m=np.round(surface.height_m / STEP_M) * STEP_M)
    known = {"scene": asdict(sample.scene), "truth": _rounded(truth)}
    write_hdf5(rounded, folder / f"{sample.name}.h5", truth=known, unit="nm", dtype="float32")
    text = json.dumps(known, indent=1)
    (folder / f"{sample.name}.truth.json").write_text(text + "\n", encoding="utf-8")
    return _section(sample, surface, truth)


def _rounded(truth: Truth) -> dict[str, Any]:
    """Return the truth as plain lists of numbers on which all machines agree."""
    numbers = {name: np.asarray(value).tolist() for name, value in vars(truth).items()}
    return json.loads(
        json.dumps(numbers), parse_float=lambda text: float(f"{float(text):.{DIGITS}g}")
    )


def _head() -> str:
    return f"""# Sample surfaces

Synthetic faces of known content, written by `make samples`; the same bytes every time. Each is
a native HDF5 file, with its scene and truth beside it in `*.truth.json` (and inside, in `/truth`).

Radii and height difference are those of Peyret, Chevallier and Dion 2016 (Table 2): G-caps of
{RADIUS_G_M} m, P-caps of {RADIUS_P_M} m with peaks {H_M * 1e6:g} um lower.
The paper gives neither the size of the face nor that of the pixel: 60 x 40 mm and 50 um are
stand-ins. The heights of the caps above the cut follow from the areas: at the cut their discs
fill 10 % of the face.

Heights are stored in nm as float32, rounded to {STEP_M * 1e9:g} nm so that the files
pack well; that is far below the noise.

Peak heights count from the least-squares plane of the face without form, roughness and noise.
"""


def _section(sample: Sample, surface: HeightMap, truth: Truth) -> str:
    scene: Scene = sample.scene
    (ny, nx), (dy_m, dx_m) = scene.shape, scene.pixel_size_m
    missing = 100 * (1.0 - surface.measured.mean())
    rows = [
        ("points (ny x nx)", f"{ny} x {nx}"),
        ("pixel (dy x dx)", f"{dy_m * 1e6:g} x {dx_m * 1e6:g} um"),
        ("non-measured points", f"{missing:.2f} %"),
        ("roughness + white noise (rms)", _nm(scene.roughness_rms_m, scene.noise_rms_m)),
        ("tilt (y, x)", f"{scene.tilt[0] * 1e6:g}, {scene.tilt[1] * 1e6:g} um/m"),
        ("bow (y, x)", f"{scene.bow_m[0] * 1e6:g}, {scene.bow_m[1] * 1e6:g} um"),
        ("spikes", f"{scene.n_spikes} of +-{scene.spike_m * 1e6:g} um"),
        (f"cut height at {100 * scene.material_ratio:g} %", f"{truth.cut_height_m * 1e6:.4f} um"),
    ]
    caps = [_cap_row(i, truth) for i in np.argsort(truth.family, kind="stable").tolist()]
    head = ("cap", "family", "x [mm]", "y [mm]", "R [m]", "peak [um]", "above the cut [um]")
    parts = [
        f"## {sample.name}.h5",
        sample.about,
        table(("property", "value"), rows),
        table(head, caps),
    ]
    return "\n\n".join(parts) + "\n"


def _cap_row(i: int, truth: Truth) -> tuple[Any, ...]:
    number = int((truth.family[: i + 1] == truth.family[i]).sum())
    return (
        number,
        truth.family[i],
        f"{truth.x_m[i] * 1e3:.3f}",
        f"{truth.y_m[i] * 1e3:.3f}",
        f"{truth.radius_m[i]:g}",
        f"{truth.peak_height_m[i] * 1e6:.4f}",
        f"{(truth.peak_height_m[i] - truth.cut_height_m) * 1e6:.4f}",
    )


def _nm(first_m: float, second_m: float) -> str:
    return f"{first_m * 1e9:g} + {second_m * 1e9:g} nm"


if __name__ == "__main__":
    write_samples(sys.argv[1] if len(sys.argv) > 1 else "sample_surfaces")
