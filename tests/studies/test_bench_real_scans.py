"""The timings of real scans are of answers, with intervals and under many pressures."""

import numpy as np

from capslip.studies.bench import real_scans
from scenes import caps_map

CAPS = [(0.003, 0.004, 20.0, 0.0), (0.012, 0.015, 25.0, 2e-8), (0.024, 0.006, 22.0, 1e-8)]
AS_METRES = ("reading.unit='m'", "reading.lateral_unit='m'", "reading.pixel_size=[2e-4,2e-4]")


def test_each_scan_has_its_times_and_other_files_none(tmp_path, monkeypatch):
    asked, analyze = [], real_scans.analyze

    def seen(surface, settings):
        found = analyze(surface, settings)
        asked.append((found.band, len(found.joint.load_N)))
        return found

    monkeypatch.setattr(real_scans, "REPEATS", 1)
    monkeypatch.setattr(real_scans, "analyze", seen)
    np.save(tmp_path / "face.npy", caps_map(CAPS, (100, 150), pixel_size_m=(2e-4, 2e-4)).height_m)
    np.save(tmp_path / "flat.npy", np.zeros((30, 30)))
    (tmp_path / "README.md").write_text("no scan")
    given = ("contact.model='families'", "contact.nominal_pressure_Pa=1e5")
    given += ("material.preset='steel'",)  # else there is no hardness to be uncertain of
    head, _, *rows = real_scans.bench_real_scans(tmp_path, (*AS_METRES, *given)).splitlines()
    assert [row.split("`")[1] for row in rows] == ["face.npy", "flat.npy"]
    assert rows[1].count("none") == 3
    first = [cell.strip() for cell in rows[0].strip("|").split("|")]
    cells = dict(zip(real_scans.HEAD, first, strict=True))
    assert cells["points"] == "150 x 100"
    whole_s, band_s = (float(cells[name]) for name in real_scans.HEAD[2:4])
    assert 0.0 <= band_s <= whole_s + 0.5
    assert float(cells["1,000 patches [s]"]) > 0.0
    assert head.startswith("| scan |")
    (band, one), (_, many) = asked[:2]
    assert {"friction", "preload", "modulus"} <= set(band.contributions["energy_J"])
    assert one == 1
    assert 50 < many < 100  # classes of the pressures
