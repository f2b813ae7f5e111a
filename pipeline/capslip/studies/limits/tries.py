"""On which faces and at which loads an axis is tried: what stands in the column `tries`."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from capslip.studies.faces.scenes import PAPER
from capslip.studies.faces.synthetic import Cap, CapFamily, Scene, reaches_cut, synthetic_surface
from capslip.studies.limits import changes
from capslip.studies.limits.case import PRELOAD_N, Tries
from capslip.studies.page import Row
from capslip.surface.form import remove_form
from capslip.surface.heightmap import HeightMap

SHAPE, PIXEL_M = (200, 300), (2e-4, 2e-4)  # a face of 60 mm x 40 mm
APART = 1000  # between the seeds of two sets of faces; those of one set differ by less
DRAWS, EVERY = 20, 3  # of 20 draws of the places, sorted by the tilt, every third
REDRAWS = 20  # of caps that do not all reach the cut


def random_face(seed: int, *families: CapFamily, gap_m: float = 1e-3) -> Scene:
    """Return a face of caps at random places."""
    return Scene(SHAPE, PIXEL_M, seed=seed, families=families, gap_m=gap_m)


def scattered_face(spread_m: float, seed: int) -> Scene:
    """Return a face of 8 G-caps and 12 P-caps, 0.1 um apart, whose heights and radii scatter.

    Where the lowest would lie below the cut it is drawn again: one face in some hundred of the
    widest spread, for which no study of them all has to end.
    """
    rng = np.random.default_rng(seed)
    for _ in range(REDRAWS):
        face = random_face(seed, *_scattered_caps(spread_m, rng))
        if reaches_cut(face):
            return face
    return face  # nothing that is drawn is made at this spread: whoever makes it is told


def _scattered_caps(spread_m: float, rng: np.random.Generator) -> list[CapFamily]:
    return [
        CapFamily(
            name,
            1,
            22.0 * math.exp(0.2 * rng.standard_normal()),
            below_m + spread_m * (1.5 + float(np.clip(rng.standard_normal(), -1.5, 1.5))),
        )
        for name, count, below_m in (("G", 8, 0.0), ("P", 12, 0.1e-6))
        for _ in range(count)
    ]


def two_families(h_m: float, face: int) -> Scene:
    """Return the caps of the paper, the P-caps `h_m` lower."""
    return random_face(face, PAPER[0], replace(PAPER[1], below_m=h_m))


def hidden_family(h_m: float, face: int) -> Scene:
    """Return the same, filling 15 % of the face: P-caps sink towards the cut of 10 %, and below."""
    return replace(two_families(h_m, face), material_ratio=0.15)


def few_caps(count: float, face: int) -> Scene:
    """Return a face of few equal caps."""
    return random_face(face + int(count), CapFamily("G", int(count), 40.0))


def wavy(length_m: float, face: int) -> Scene:
    """Return a face of waves of that correlation length."""
    return Scene(SHAPE, PIXEL_M, seed=face, waviness_rms_m=0.4e-6, waviness_length_m=length_m)


def self_affine(hurst: float, face: int) -> Scene:
    """Return a self-affine face."""
    return replace(wavy(3e-3, face), waviness_spectrum="power_law", hurst_exponent=hurst)


def paired_caps(apart: float, face: int) -> Scene:
    """Return a face of ten caps, six of them in pairs so many disc radii apart."""
    return _lattice(face, apart, None)


def caps_at_edge(inside: float, face: int) -> Scene:
    """Return a face of eight caps, four of them with the apex so many disc radii inside."""
    return _lattice(face, 0.0, inside)


def harmless_faces(seed: int) -> dict[str, tuple[Scene, float]]:
    """Return the faces on which most axes are tried, with their preloads.

    Nothing is doubtful about them, so a warning speaks of what the axis does to them.
    """
    first = APART * seed
    smaller = CapFamily("G", 10, 15.0), CapFamily("P", 12, 20.0, 0.1e-6)
    return {
        "caps of the paper": (random_face(first + 1, *PAPER), 200.0),
        "caps of some spread": (scattered_face(1e-8, first + 3), 200.0),
        "smaller caps": (random_face(first + 2, *smaller), PRELOAD_N),
    }


def on_faces(text: str, fields: Callable[[Any], Row]) -> Tries:
    """Try a value on each harmless face; `fields` are those of the case."""
    return _on_faces(text, lambda face, x, seed: fields(x))


def with_scene(text: str, fields: Callable[[Any], Row], *overrides: str) -> Tries:
    """Try a value on each harmless face; `fields` are those of the scene."""
    return _on_faces(
        text, lambda face, x, seed: {"scene": replace(face, **fields(x)), "overrides": overrides}
    )


def with_change(which: str, text: str, change: Callable[..., HeightMap]) -> Tries:
    """Try a change of the map on each harmless face: a `face_change` or a `scan_change`."""
    return _on_faces(text, lambda face, x, seed: {which: partial(change, x=x, seed=APART * seed)})


def at_loads(
    text: str,
    scene: Callable[[Any, int], Scene],
    loads_N: tuple[float, ...],
    faces: tuple[int, ...],
) -> Tries:
    """Try a value at several preloads, on faces of several seeds."""

    def tries(seed: int, x: float) -> Iterator[Row]:
        for preload_N in loads_N:
            for face in (APART * seed + one for one in faces):
                name = text.format(x=x, nm=1e9 * x, mm=1e3 * x, load=preload_N, face=face)
                yield {"name": name, "scene": scene(x, face), "preload_N": preload_N}

    return tries


def rough(rms_m: float) -> Row:
    """Return what of a scene makes its face rough."""
    return {"roughness_rms_m": rms_m, "roughness_length_m": 1e-3}


def uneven_counts(seed: int, counts: tuple[int, int]) -> Iterator[Row]:
    """Try m G-caps and n P-caps on two faces; the severity is the smaller count."""
    m, n = counts
    p_caps = replace(PAPER[1], count=n, below_m=min(2e-7, 8e-7 / (m + n)))
    for face in (APART * seed + 5, APART * seed + 6):
        scene = random_face(face, CapFamily("G", m, 23.8), *((p_caps,) if n else ()))
        name = f"m = {m}, n = {n}, seed {face}"
        yield {"severity": float(min(counts)), "name": name, "scene": scene}


def equal_caps(seed: int, noise_m: float) -> Iterator[Row]:
    """Try equal caps, few and many."""
    for count in (3, 5, 12, 23, 40):
        scene = random_face(APART * seed + 30 + count, CapFamily("G", count, 25.0))
        name = f"{count} caps, noise {noise_m * 1e9:g} nm"
        yield {"name": name, "scene": replace(scene, noise_rms_m=noise_m)}


def many_points(seed: int, points: tuple[int, str]) -> Iterator[Row]:
    """Try one harmless face with many points."""
    nx, name = points
    face, preload_N = harmless_faces(seed)[name]
    yield {
        "severity": float(nx),
        "name": f"{nx} points along the face, {name}",
        "scene": replace(face, **points_along(nx)),
        "preload_N": preload_N,
    }


def points_along(nx: float) -> Row:
    """Return what of a scene gives its face `nx` points along the longer side."""
    return {"shape": (2 * int(nx) // 3, int(nx)), "pixel_size_m": (60e-3 / nx, 60e-3 / nx)}


def pixel_ratio(ratio: float) -> Row:
    """Return what of a scene gives its face pixels of dy / dx = `ratio`, of the same area."""
    dy_m, dx_m = PIXEL_M[0] * math.sqrt(ratio), PIXEL_M[1] / math.sqrt(ratio)
    ny, nx = round(40e-3 / dy_m), round(60e-3 / dx_m)
    return {"shape": (ny, nx), "pixel_size_m": (40e-3 / ny, 60e-3 / nx)}


def spikes(seed: int, spike: tuple[int, float]) -> Iterator[Row]:
    """Try a number of spikes of one height on each harmless face."""
    number, spike_m = spike
    tries = with_scene(
        f"{number} spikes of {spike_m * 1e6:g} um", lambda x: {"n_spikes": number, "spike_m": x}
    )
    for found in tries(seed, spike_m):
        yield {"severity": spike_m * number, **found}


def off_balance(seed: int, lowered_m: float | None) -> list[Row]:
    """Try the harmless faces with a least-squares plane that what touches does not set.

    Their caps lie where they fall, or half of the floor is lowered. The floor is level in the truth
    as levelled, and the tilt of that plane against it is the severity, to one digit.
    """
    found: list[Row] = []
    for name, (face, preload_N) in harmless_faces(seed).items():
        if lowered_m is not None:
            text = f"half of the floor {lowered_m:g} m lower, {name}"
            change = partial(changes.lowered, x=lowered_m, seed=seed)
            surface = change(*synthetic_surface(face))
            case: Row = {"severity": _tilt_m(surface), "name": text, "scene": face}
            found.append({**case, "preload_N": preload_N, "scan_change": change})
            continue
        fallen = []
        for i in range(1, DRAWS + 1):
            scene = replace(face, seed=face.seed + i, balanced=False)
            text = f"caps where they fall, draw {i}, {name}"
            case = {"severity": _tilt_m(synthetic_surface(scene)[0]), "name": text, "scene": scene}
            fallen.append({**case, "preload_N": preload_N})
        found += sorted(fallen, key=lambda case: case["severity"])[::EVERY]
    return sorted(found, key=lambda case: case["severity"])


def _on_faces(text: str, fields: Callable[[Scene, Any, int], Row]) -> Tries:
    def tries(seed: int, x: Any) -> Iterator[Row]:
        for name, (face, preload_N) in harmless_faces(seed).items():
            case = {"name": f"{text.format(x)}, {name}", "scene": face, "preload_N": preload_N}
            yield case | fields(face, x, seed)

    return tries


def _lattice(seed: int, pairs_apart: float, edge: float | None) -> Scene:
    """Return a face of caps of 25 m, 0.2 um above the cut; some in pairs, or some at the edge.

    Distances are in radii of the disc at the cut. Other seeds than 0 shift every cap, pair by pair
    and along the edge, and change all radii.
    """
    rng = np.random.default_rng(seed)

    def moved() -> float:
        return rng.uniform(-0.5e-3, 0.5e-3) if seed else 0.0

    radius_m, height_m = 25.0 * (rng.uniform(0.9, 1.1) if seed else 1.0), 0.2e-6
    disc_m = math.sqrt(2.0 * radius_m * height_m)
    if edge is not None:
        inside_m = edge * disc_m
        at = [(inside_m, y_m + moved()) for y_m in (8e-3, 21e-3)]
        at += [(x_m + moved(), inside_m) for x_m in (21e-3, 41e-3)]
        lone = ((16e-3, 14e-3), (31e-3, 18e-3), (46e-3, 25e-3), (19e-3, 31e-3))
        at += [(x_m + moved(), y_m + moved()) for x_m, y_m in lone]
    else:
        half_m = pairs_apart * disc_m / 2.0
        along_m, up_m = 0.8 * half_m, 0.6 * half_m
        lone = ((17e-3, 9e-3), (43e-3, 10e-3), (10e-3, 28e-3), (52e-3, 30e-3))
        at = [(x_m + moved(), y_m + moved()) for x_m, y_m in lone]
        for x_m, y_m in ((30e-3, 16e-3), (24e-3, 32e-3), (38e-3, 34e-3)):
            x_m, y_m = x_m + moved(), y_m + moved()
            at += [(x_m - along_m, y_m - up_m), (x_m + along_m, y_m + up_m)]
    caps = tuple(Cap(x_m, y_m, radius_m, height_m, "G") for x_m, y_m in at)
    return Scene(SHAPE, PIXEL_M, caps=caps)


def _tilt_m(surface: HeightMap) -> float:
    """Rise of the least-squares plane over the face, corner to corner, to one digit."""
    level, _ = remove_form(surface, "plane")
    return float(f"{np.ptp(surface.height_m - level.height_m):.0e}")
