"""Five maps of known parameters, and what surfalize 0.19.2 says of them (`iso_maps.json`).

Run by itself, in an environment with surfalize, it writes these values anew. That library is GPL:
neither the package nor any test imports it.
"""

import json
from pathlib import Path

import numpy as np

VALUES = Path(__file__).with_suffix(".json")
NAMES = ("Sa", "Sq", "Ssk", "Sku", "Sp", "Sv", "Sz", "Sal", "Str", "Spc", "S5p", "Svc", "S5v")
CAPS = [(14, 11, 40.0, 1.0), (41, 30, 60.0, 0.6), (60, 12, 50.0, 0.8), (20, 38, 45.0, 0.3)]


def waves(lengths_um, shape, pixel_um, seed):
    """Return 60 cosines of random direction and phase, periodic in the map, heights in µm."""
    rng = np.random.default_rng(seed)
    side_um = np.array(shape) * pixel_um
    y, x = ((np.arange(n) + 0.5) * size for n, size in zip(shape, pixel_um, strict=True))
    z = np.zeros(shape)
    for _ in range(60):
        ky, kx = np.rint(rng.normal(size=2) * side_um / lengths_um)
        phase = rng.uniform(0.0, 2.0 * np.pi)
        z += np.cos(2 * np.pi * (ky * y[:, None] / side_um[0] + kx * x / side_um[1]) + phase)
    return z / 10.0


def spheres():
    """Return caps on a plane with a little noise, in µm."""
    y, x = np.mgrid[0:100, 0:150] * 0.5 + 0.25
    z = np.zeros(x.shape)
    for x0, y0, radius, top in CAPS:
        z = np.maximum(z, top - ((x - x0) ** 2 + (y - y0) ** 2) / (2.0 * radius))
    return z + 1e-3 * np.random.default_rng(4).standard_normal(z.shape)


def maps():
    """Return name -> (heights in µm, (dy, dx) in µm)."""
    y, x = np.mgrid[0:120, 0:200] + 0.5
    return {
        "sine": (2.0 * np.sin(2 * np.pi * x / 40), (1.0, 1.0)),
        "egg_crate": (np.cos(2 * np.pi * x / 33.1) * np.cos(2 * np.pi * y / 27.3), (2.0, 1.0)),
        "isotropic": (waves((12.0, 12.0), (120, 160), (1.0, 1.0), 2), (1.0, 1.0)),
        "lay": (waves((60.0, 8.0), (120, 160), (1.5, 1.0), 3), (1.5, 1.0)),
        "spheres": (spheres(), (0.5, 0.5)),
    }


def main():
    from surfalize import Surface

    found = {}
    for name, (height_um, (dy_um, dx_um)) in maps().items():
        surface = Surface(height_um, dx_um, dy_um)
        values = {parameter: float(getattr(surface, parameter)()) for parameter in NAMES}
        area = (height_um.shape[0] - 1) * (height_um.shape[1] - 1) * dy_um * dx_um  # as there
        for one in ("Spd", "Svd"):
            values[f"{one}_count"] = round(getattr(surface, one)() * area)
            values[f"{one}_count_open"] = round(getattr(surface, one)(exclude_edge=False) * area)
        values["Std_deg"] = float(surface.Std())
        found[name] = {key: None if np.isnan(value) else value for key, value in values.items()}
    VALUES.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
