"""Time of whole answers on real scans: as a joint, its intervals, and under 1,000 pressures.

`python -m capslip.studies.bench.real_scans FOLDER [--set KEY=VALUE ...]` prints the table.
"""

import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from capslip.analysis import analyze
from capslip.errors import CapslipError
from capslip.settings import load_settings
from capslip.studies.page import table
from capslip.studies.real_scans import AS_A_JOINT, print_of_folder, scans_of
from capslip.surface.heightmap import HeightMap

REPEATS = 3
SPREADS = (
    "material.friction_spread=0.1",
    "material.modulus_spread=0.05",
    "material.hardness_spread=0.1",
    "contact.preload_spread=0.1",
)
# Of the joint that is pressed unevenly: pressures from a tenth of the greatest on
PATCHES, GREATEST_PA, AREA_M2 = 1000, 6e6, 1.6e-6
HEAD = ("scan", "points", "whole answer [s]", "of it the intervals [s]", "1,000 patches [s]")


def main() -> None:
    """Print the table of every scan of a folder that can be read."""
    print_of_folder(bench_real_scans, __doc__)


def bench_real_scans(folder: Path, overrides: Sequence[str] = AS_A_JOINT) -> str:
    """Time every scan of a folder.

    Parameters
    ----------
    folder : Path
        What cannot be read as a scan is left out.
    overrides : sequence of str
        Settings as `--set` takes them.

    Returns
    -------
    str
        A table in Markdown, least of three runs each: seconds of the processor of an answer with
        what is uncertain in friction, load, modulus and hardness; what its intervals take of that,
        by the clock; and seconds of the processor of a joint of 1,000 patches, each under its own
        pressure.
    """
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        uneven = Path(scratch) / "pressures.csv"
        pressures_Pa = np.linspace(0.1 * GREATEST_PA, GREATEST_PA, PATCHES).tolist()
        lines = ["pressure_Pa,area_m2", *(f"{p_Pa!r},{AREA_M2}" for p_Pa in pressures_Pa)]
        uneven.write_text("\n".join(lines), encoding="utf-8")
        alike = (*overrides, *SPREADS)
        load = ("contact.nominal_pressure_Pa", "contact.preload_N")
        other = [one for one in overrides if not one.startswith(load)]
        for name, surface in scans_of(folder, load_settings(overrides=tuple(overrides))):
            points = " x ".join(map(str, surface.shape[::-1]))
            found = _seconds(surface, alike)
            joint = _seconds(surface, (*other, f"joint.pressure_map='{uneven}'"))
            rows.append((f"`{name}`", points, *found, joint[0]))
    return table(HEAD, rows)


def _seconds(surface: HeightMap, overrides: Sequence[str]) -> tuple[str, str]:
    """Return the least seconds of a whole answer and of its intervals; none where there is none."""
    settings, whole_s, band_s = load_settings(overrides=tuple(overrides)), [], []
    for _ in range(REPEATS):
        begun_s = time.process_time()
        try:
            found = analyze(surface, settings)
        except CapslipError:
            return "none", "none"
        whole_s.append(time.process_time() - begun_s)
        band_s.append(found.timings_s.get("band", 0.0))
    return f"{min(whole_s):.2f}", f"{min(band_s):.2f}"


if __name__ == "__main__":
    main()
