"""Synthetic faces whose content is known: caps, form, waves, noise and defects, all seeded."""

import math
from dataclasses import asdict, dataclass, replace
from typing import Literal

import numpy as np

from capslip.errors import SettingsError, check_kind
from capslip.studies.faces.finer import finer_waves
from capslip.studies.faces.placing import balanced_places, free_places
from capslip.surface.heightmap import HeightMap, Origin

BALANCING_STEPS = 40
LEVEL_M = 1e-15  # rise of the least-squares plane over half the face at which it is level
NOT_NEGATIVE = ("seed", "n_spikes", "n_patches", "non_measured_fraction")
DRAWS = 20  # of places that can be balanced


@dataclass(frozen=True)
class CapFamily:
    """Equal caps that are placed at random; peaks `below_m` under those of the highest family."""

    name: str
    count: int
    radius_m: float
    below_m: float = 0.0


@dataclass(frozen=True)
class Cap:
    """One cap at a given place; its peak is counted from the nominal cut height."""

    x_m: float
    y_m: float
    radius_m: float
    height_m: float
    family: str = ""


@dataclass(frozen=True)
class Scene:
    """What a synthetic face holds.

    The surface is the higher of floor and caps at every point. The families are placed so that at
    the cut their discs are at least `gap_m` apart and inside the face, and as high as makes the
    discs of all caps fill `material_ratio` of it. The floor is level. On top come roughness, form,
    noise, spikes and, last, the non-measured points.

    Attributes
    ----------
    shape : (int, int)
        (ny, nx).
    pixel_size_m : (float, float)
        (dy, dx).
    seed : int
        Same seed, same face.
    families, caps
        Caps placed at random, and caps at given places.
    material_ratio : float
        Share of the face that the discs of the caps fill at the cut.
    gap_m : float
        Least distance between discs, and from the edge.
    balanced : bool
        True: the families lie so that the least-squares plane of the whole is level, too. False:
        they lie where they fall, and that plane is tilted by it.
    floor_m : float
        Depth of the floor below the nominal cut height.
    waviness_rms_m, waviness_length_m : float
        Waves of the floor: rms height, and the distance at which the correlation is 1/e.
    waviness_spectrum : {"gaussian", "power_law"}
        Shape of the power spectrum; "power_law" is that of a self-affine surface of
        `hurst_exponent` below the wavelength 2 pi `waviness_length_m`, flat above.
    roughness_rms_m, roughness_length_m : float
        Short waves over the whole face, Gaussian spectrum.
    noise_rms_m : float
        White noise, point by point.
    tilt : (float, float)
        Slopes along y and x.
    bow_m : (float, float)
        Quadratic rise of the edges over the middle, along y and x.
    cylinder_radius_m : float or None
        Convex cylinder, axis along y.
    n_spikes, spike_m
        Single points moved by +-spike_m.
    non_measured_fraction : float
        Share of single points lost.
    n_patches, patch_radius_m
        Round non-measured patches.
    """

    shape: tuple[int, int] = (800, 1200)
    pixel_size_m: tuple[float, float] = (50e-6, 50e-6)
    seed: int = 0
    families: tuple[CapFamily, ...] = ()
    caps: tuple[Cap, ...] = ()
    material_ratio: float = 0.10
    gap_m: float = 1e-3
    balanced: bool = True
    floor_m: float = 0.5e-6
    waviness_rms_m: float = 0.0
    waviness_length_m: float = 5e-3
    waviness_spectrum: Literal["gaussian", "power_law"] = "gaussian"
    hurst_exponent: float = 0.8
    roughness_rms_m: float = 0.0
    roughness_length_m: float = 0.2e-3
    noise_rms_m: float = 0.0
    tilt: tuple[float, float] = (0.0, 0.0)
    bow_m: tuple[float, float] = (0.0, 0.0)
    cylinder_radius_m: float | None = None
    n_spikes: int = 0
    spike_m: float = 0.0
    non_measured_fraction: float = 0.0
    n_patches: int = 0
    patch_radius_m: float = 0.0


@dataclass(frozen=True, eq=False)
class Truth:
    """What an analysis of a synthetic face should find.

    Attributes
    ----------
    x_m, y_m, radius_m, peak_height_m : float64, shape (n,)
        Apexes and radii of the caps as placed. Heights count from the mean height of the face
        without roughness, form and defects, parallel to its floor.
    family : str, shape (n,)
        Names of the families.
    cut_height_m : float
        Smc(material ratio) of that face.
    """

    x_m: np.ndarray
    y_m: np.ndarray
    radius_m: np.ndarray
    peak_height_m: np.ndarray
    family: np.ndarray
    cut_height_m: float


def synthetic_surface(
    scene: Scene, name: str = "synthetic", finer: int = 1
) -> tuple[HeightMap, Truth]:
    """Make the height map of a scene and the truth about it.

    Parameters
    ----------
    scene : Scene
        What the face holds.
    name : str
        Name of the map.
    finer : int
        Points along the side of a pixel: the same face on so much smaller pixels, for scenes
        without noise, spikes and non-measured points, which are of the points of the map.

    Returns
    -------
    HeightMap, Truth
        The map, and its caps in the frame that removal of the form should restore.

    Raises
    ------
    SettingsError
        If the caps of the families do not fit on the face, or not in balance, or a number is out
        of bounds, or what is asked on finer pixels is not defined there.

    Notes
    -----
    A face is a function of place, and its map that at the centres of the pixels. Caps and form are
    their formulas, waves and roughness the sum of the sinusoids that the transform of the map
    holds: nothing is shorter than two pixels, on finer pixels too.

    The slope of the least-squares plane is as the sum of V x, with the volume V of each cap above
    the floor and its place x from the middle. In a balanced scene the places are such that it
    vanishes: removing the plane then leaves the peak heights as they are in the truth. Caps at
    given places stay there; without families nothing can balance them.

    Examples
    --------
    >>> family = CapFamily("G", 3, radius_m=24.0)
    >>> scene = Scene(shape=(200, 300), pixel_size_m=(2e-4, 2e-4), families=(family,))
    >>> surface, truth = synthetic_surface(scene)
    >>> bool(abs(surface.height_m.max() - truth.peak_height_m.max()) < 1e-9)
    True
    """
    _check(scene, finer)
    rng = np.random.default_rng(scene.seed)
    fine = _on_finer(scene, finer)
    y_m, x_m = _axes(fine)
    floor_m = np.full(scene.shape, -float(scene.floor_m))
    fine_floor_m = np.full(fine.shape, -float(scene.floor_m))
    if scene.waviness_rms_m:
        waves_m = _waves(
            scene,
            rng,
            scene.waviness_rms_m,
            scene.waviness_length_m,
            scene.waviness_spectrum,
        )
        rise_m = _rise_m(waves_m)
        floor_m += _level(waves_m, rise_m)
        fine_floor_m += _level(finer_waves(waves_m, finer), rise_m, finer)
    caps = (*_placed(scene, rng, floor_m), *scene.caps)
    height_m = _joined(scene, caps, floor_m)
    level_m = float(height_m.mean())
    height_m -= level_m
    truth = Truth(
        x_m=np.array([cap.x_m for cap in caps]),
        y_m=np.array([cap.y_m for cap in caps]),
        radius_m=np.array([cap.radius_m for cap in caps]),
        peak_height_m=np.array([cap.height_m - level_m for cap in caps]),
        family=np.array([cap.family for cap in caps], dtype="<U8"),
        cut_height_m=float(np.quantile(height_m, 1.0 - scene.material_ratio)),
    )
    if finer > 1:
        height_m = _joined(fine, caps, fine_floor_m) - level_m
    if scene.roughness_rms_m:
        rough_m = _waves(scene, rng, scene.roughness_rms_m, scene.roughness_length_m, "gaussian")
        height_m += finer_waves(rough_m, finer)
    height_m += _form(scene, y_m, x_m)
    _add_defects(scene, rng, height_m, y_m, x_m)
    return HeightMap(height_m, fine.pixel_size_m, Origin(name=name)), truth


def reaches_cut(scene: Scene) -> bool:
    """Tell whether the caps of all families of a scene would reach the cut, as they must."""
    if not scene.families:
        return True
    return _top_and_lowest_m(scene)[2]


def _on_finer(scene: Scene, finer: int) -> Scene:
    """Return the scene on a grid of smaller pixels."""
    (ny, nx), (dy_m, dx_m) = scene.shape, scene.pixel_size_m
    return replace(scene, shape=(finer * ny, finer * nx), pixel_size_m=(dy_m / finer, dx_m / finer))


def _check(scene: Scene, finer: int) -> None:
    check_kind("scene", scene, Scene, "a Scene")
    if len(scene.shape) != 2 or min(scene.shape) < 3:
        raise SettingsError(f"scene.shape: got {scene.shape}; expected two numbers >= 3")
    if not all(0 < side_m < math.inf for side_m in scene.pixel_size_m):
        raise SettingsError(
            f"scene.pixel_size_m: got {scene.pixel_size_m}; expected two positive numbers (dy, dx)"
        )
    of_points = (scene.noise_rms_m, scene.n_spikes, scene.non_measured_fraction)
    if finer < 1 or (finer > 1 and any(of_points)):
        raise SettingsError(
            f"scene: got {finer} points along a pixel; expected 1 or more, and 1 with noise, "
            "spikes or non-measured points, which are not defined between the points of the map"
        )
    for key, value in asdict(scene).items():
        if key.endswith("_rms_m") or key in NOT_NEGATIVE:
            if not 0 <= value < math.inf:
                raise SettingsError(f"scene.{key}: got {value}; expected 0 or more")
        elif key.endswith("_length_m") and not 0 < value < math.inf:
            raise SettingsError(f"scene.{key}: got {value}; expected a positive length")
    if not 0 < scene.material_ratio < 1 or not scene.non_measured_fraction < 1:
        raise SettingsError(
            f"scene: material_ratio {scene.material_ratio}, non_measured_fraction "
            f"{scene.non_measured_fraction}; expected shares below 1"
        )
    given: list[CapFamily | Cap] = [*scene.families, *scene.caps]
    for item in given:
        if not 0 < item.radius_m < math.inf:
            raise SettingsError(f"scene: {item}; expected a positive radius")


def _axes(scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    (ny, nx), (dy_m, dx_m) = scene.shape, scene.pixel_size_m
    return (np.arange(ny) + 0.5) * dy_m, (np.arange(nx) + 0.5) * dx_m


def _sides(scene: Scene) -> tuple[float, float]:
    return scene.shape[0] * scene.pixel_size_m[0], scene.shape[1] * scene.pixel_size_m[1]


def _disc_radius_m(radius_m: float, height_m: float) -> float:
    """Radius of the circle in which a sphere is cut `height_m` below its apex."""
    return math.sqrt(height_m * (2.0 * radius_m - height_m))


def _placed(scene: Scene, rng: np.random.Generator, floor_m: np.ndarray) -> tuple[Cap, ...]:
    """Give the families their height above the cut, and a place to each of their caps."""
    if not scene.families:
        return ()
    top_m = _top_height_m(scene)
    unplaced = [
        Cap(0.0, 0.0, family.radius_m, top_m - family.below_m, family.name)
        for family in sorted(scene.families, key=lambda f: f.below_m)
        for _ in range(family.count)
    ]
    disc_m = np.array([_disc_radius_m(cap.radius_m, cap.height_m) for cap in unplaced])
    given = np.array(
        [
            (cap.x_m, cap.y_m, _disc_radius_m(cap.radius_m, max(cap.height_m, 0.0)))
            for cap in scene.caps
        ]
    )
    for _ in range(DRAWS):
        place_m = free_places(rng, disc_m, given, scene.gap_m, _sides(scene))
        if not scene.balanced:
            return _at(unplaced, place_m)
        balanced_m = _balanced(scene, floor_m, unplaced, place_m, disc_m, given)
        if balanced_m is not None:
            return _at(unplaced, balanced_m)
    raise SettingsError(
        f"scene: {len(unplaced)} caps found no places in which their least-squares plane is level; "
        "lower gap_m, the counts or material_ratio, try another seed, or set balanced to false"
    )


def _at(caps: list[Cap], place_m: np.ndarray) -> tuple[Cap, ...]:
    return tuple(
        replace(cap, x_m=x_m, y_m=y_m)
        for cap, (x_m, y_m) in zip(caps, place_m.tolist(), strict=True)
    )


def _balanced(
    scene: Scene,
    floor_m: np.ndarray,
    caps: list[Cap],
    place_m: np.ndarray,
    disc_m: np.ndarray,
    given: np.ndarray,
) -> np.ndarray | None:
    """Move the caps until the least-squares plane of the whole is level; None if they do not.

    The volumes of single caps tell the moment but roughly, as caps overlap at their feet and reach
    over the edge. So the moment that is missing on the map is added to the one that is aimed at.
    """
    f_m = np.array([max(cap.height_m + scene.floor_m, 0.0) for cap in caps])
    radius_m = np.array([cap.radius_m for cap in caps])
    volume_m3 = math.pi * f_m**2 * (radius_m - f_m / 3.0)
    side_y, side_x = _sides(scene)
    middle_m = np.array([0.5 * side_x, 0.5 * side_y])
    aim_m4 = volume_m3.sum() * middle_m
    for _ in range(BALANCING_STEPS):
        found_m = balanced_places(
            place_m, volume_m3, disc_m, given, scene.gap_m, (side_y, side_x), aim_m4
        )
        if found_m is None:
            return None
        place_m = found_m
        rise_m = _rise_m(_joined(scene, (*_at(caps, place_m), *scene.caps), floor_m))
        if np.abs(rise_m).max() < LEVEL_M:
            return place_m
        # The moment of a plane that rises by r from the middle to the edge is A r L / 6
        aim_m4 = aim_m4 - side_y * side_x * rise_m[::-1] * middle_m / 3.0
    return None


def _top_height_m(scene: Scene) -> float:
    """Height of the highest family above the cut."""
    top_m, below_m, reaches = _top_and_lowest_m(scene)
    if not reaches:
        raise SettingsError(
            f"scene: peaks {below_m:g} m below the highest would not reach the cut at "
            f"{100 * scene.material_ratio:g} %; lower below_m, the count or the radius"
        )
    return top_m


def _top_and_lowest_m(scene: Scene) -> tuple[float, float, bool]:
    """Height of the highest family above the cut, the lowest below it, and if all reach the cut.

    The discs of a family of n caps have the area n pi f (2 R - f), f the height above the cut; all
    of them together fill what the caps at given places leave of the material ratio. Newton's
    method from the value for f << R.
    """
    side_y, side_x = _sides(scene)
    given = float((_highest_cap(scene, scene.caps, 0.0) >= 0.0).mean()) if scene.caps else 0.0
    wanted_m2 = (scene.material_ratio - given) * side_y * side_x
    n = np.array([family.count for family in scene.families], dtype=float)
    radius_m = np.array([family.radius_m for family in scene.families])
    below_m = np.array([family.below_m for family in scene.families])
    weight_m = 2.0 * math.pi * n * radius_m
    top_m = (wanted_m2 + weight_m @ below_m) / weight_m.sum()
    for _ in range(5):
        f_m = top_m - below_m
        area_m2 = math.pi * (n * f_m) @ (2.0 * radius_m - f_m)
        top_m -= (area_m2 - wanted_m2) / (2.0 * math.pi * n @ (radius_m - f_m))
    lowest_m = top_m - below_m.max()
    return float(top_m), float(below_m.max()), bool(0.0 < lowest_m < radius_m.min())


def _highest_cap(scene: Scene, caps: tuple[Cap, ...], lowest_m: float) -> np.ndarray:
    """Height of the highest sphere at every point; -inf where none rises above `lowest_m`."""
    y_m, x_m = _axes(scene)
    highest_m = np.full(scene.shape, -np.inf)
    for cap in caps:
        if cap.height_m <= lowest_m:
            continue
        reach_m = _disc_radius_m(cap.radius_m, min(cap.height_m - lowest_m, cap.radius_m))
        rows = slice(*np.searchsorted(y_m, (cap.y_m - reach_m, cap.y_m + reach_m)))
        cols = slice(*np.searchsorted(x_m, (cap.x_m - reach_m, cap.x_m + reach_m)))
        square_m2 = (y_m[rows, None] - cap.y_m) ** 2 + (x_m[cols] - cap.x_m) ** 2
        here = square_m2 <= reach_m**2
        # R - sqrt(R^2 - r^2) without the cancellation of two numbers near R
        under_m = np.where(here, cap.radius_m**2 - square_m2, 0.0)
        sphere_m = cap.height_m - square_m2 / (cap.radius_m + np.sqrt(under_m))
        sphere_m[~here] = -np.inf
        np.maximum(highest_m[rows, cols], sphere_m, out=highest_m[rows, cols])
    return highest_m


def _joined(scene: Scene, caps: tuple[Cap, ...], floor_m: np.ndarray) -> np.ndarray:
    """Return the higher of floor and caps."""
    caps_m = _highest_cap(scene, caps, float(floor_m.min()))
    return np.maximum(caps_m, floor_m, out=caps_m)


def _rise_m(height_m: np.ndarray) -> np.ndarray:
    """Rise of the least-squares plane from the middle to the last point, along y and x."""
    ny, nx = height_m.shape
    v, u = np.linspace(-1.0, 1.0, ny), np.linspace(-1.0, 1.0, nx)
    along_y, along_x = v @ height_m.sum(axis=1), u @ height_m.sum(axis=0)
    return np.array([along_y / (nx * (v @ v)), along_x / (ny * (u @ u))])


def _level(height_m: np.ndarray, rise_m: np.ndarray, finer: int = 1) -> np.ndarray:
    """Subtract the slopes of a plane, not its height; it rises to the last point of the map."""
    for axis, rise in enumerate(rise_m.tolist()):
        n = height_m.shape[axis] // finer
        last = (n - 1.0 / finer) / (n - 1.0) if n > 1 else 1.0  # of the finer pixels
        ramp = rise * np.linspace(-last, last, n * finer)
        height_m = height_m - (ramp[:, None] if axis == 0 else ramp)
    return height_m


def _waves(
    scene: Scene, rng: np.random.Generator, rms_m: float, length_m: float, spectrum: str
) -> np.ndarray:
    """Random waves of exactly the given rms height, by filtering white noise in Fourier space."""
    from scipy import fft

    ny, nx = scene.shape
    q_y = 2.0 * math.pi * np.fft.fftfreq(ny, scene.pixel_size_m[0])[:, None]
    q_x = 2.0 * math.pi * np.fft.rfftfreq(nx, scene.pixel_size_m[1])
    square = (q_y**2 + q_x**2) * length_m**2
    if spectrum == "power_law":
        transfer = np.maximum(square, 1.0) ** (-0.5 * (1.0 + scene.hurst_exponent))
    else:  # the correlation exp(-(r/length)^2) has the power spectrum exp(-(q length/2)^2)
        transfer = np.exp(-square / 8.0)
    transfer[0, 0] = 0.0
    noise = fft.rfft2(rng.standard_normal(scene.shape), workers=1)
    waves_m: np.ndarray = fft.irfft2(noise * transfer, s=scene.shape, workers=1)
    waves_m *= rms_m / waves_m.std()
    return waves_m


def _form(scene: Scene, y_m: np.ndarray, x_m: np.ndarray) -> np.ndarray:
    side_y, side_x = _sides(scene)
    y_m, x_m = y_m[:, None] - side_y / 2.0, x_m - side_x / 2.0
    form_m = scene.tilt[0] * y_m + scene.tilt[1] * x_m
    form_m = form_m + scene.bow_m[0] * (2.0 * y_m / side_y) ** 2
    form_m = form_m + scene.bow_m[1] * (2.0 * x_m / side_x) ** 2
    radius_m = scene.cylinder_radius_m
    if radius_m is not None:
        if radius_m < side_x / 2.0:
            raise SettingsError(
                f"scene.cylinder_radius_m: got {radius_m:g}; expected at least half the face, "
                f"{side_x / 2.0:g}"
            )
        form_m = form_m - x_m**2 / (radius_m + np.sqrt(radius_m**2 - x_m**2))
    return form_m


def _add_defects(
    scene: Scene,
    rng: np.random.Generator,
    height_m: np.ndarray,
    y_m: np.ndarray,
    x_m: np.ndarray,
) -> None:
    if scene.noise_rms_m:
        height_m += scene.noise_rms_m * rng.standard_normal(scene.shape)
    if scene.n_spikes:
        at = rng.choice(height_m.size, scene.n_spikes, replace=False)
        height_m.reshape(-1)[at] += scene.spike_m * rng.choice((-1.0, 1.0), scene.n_spikes)
    if scene.non_measured_fraction:
        height_m[rng.random(scene.shape) < scene.non_measured_fraction] = np.nan
    side_y, side_x = _sides(scene)
    for _ in range(scene.n_patches):
        square_m2 = (y_m[:, None] - rng.uniform(0, side_y)) ** 2
        square_m2 = square_m2 + (x_m - rng.uniform(0, side_x)) ** 2
        height_m[square_m2 < scene.patch_radius_m**2] = np.nan
