"""Check that a result folder is complete: `python tests/check_result.py FOLDER`."""

import json
import sys
from pathlib import Path

KEYS = {
    "surface": "path sha256 shape pixel_size_m non_measured_fraction sq_m sz_m form",
    "hills": "material_ratio cut_height_m kept_fraction regions largest_region_share hills caps "
    "rejected",
    "families": "count m n h_m G P",
    "answer": "asked tangential_stiffness_N_per_m energy_J loss_factor interval",
    "contact": "alignment tilt_rad tilt_across_face_m load_point_m nominal_pressure_Pa coverage "
    "model preload_N approach_m approach_without_bulk_m first_loading_approach_m contacts "
    "stiffness_N_per_m contact_area_m2 max_pressure_Pa",
    "slip": "friction_coefficient total_slip_force_N total_slip_displacement_m limit_G_m limit_P_m "
    "tangential_stiffness_N_per_m",
    "damping": "amplitude_m loss_factor damping_ratio frequency_ratio peak_loss_factor "
    "amplitude_at_peak_m gross_slip_amplitude_m",
    "accuracy": "requested estimated model_reason",
    "provenance": "version python platform command settings_sha256 started",
}
FILES = "summary.json result.h5 caps.csv settings.toml report.html surface.vtu"


def defects(folder: Path) -> list[str]:
    """Return what is missing in a result folder."""
    summary = json.loads((folder / "summary.json").read_text(encoding="utf-8"))
    found = [f"no file {name}" for name in FILES.split() if not (folder / name).is_file()]
    found += [
        f"no key {table}.{key}"
        for table, keys in KEYS.items()
        for key in keys.split()
        if key not in summary.get(table, {})
    ]
    found += [
        f"no key {key}"
        for key in ("schema", "name", "status", "problems", "timings_s")
        if key not in summary
    ]
    if summary["hills"]["caps"] and not (folder / "caps.vtu").is_file():
        found.append("no file caps.vtu, but there are caps")
    if summary.get("status") not in ("ok", "check"):
        found.append(f"status {summary.get('status')}")
    return found


if __name__ == "__main__":
    missing = defects(Path(sys.argv[1]))
    print("\n".join(missing) or "the result is complete")
    sys.exit(bool(missing))
