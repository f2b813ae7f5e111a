"""The normal curve of the height map itself, pressed on an elastic half-space."""

import math
from dataclasses import replace
from time import thread_time

import numpy as np

from capslip.contact.map_accuracy import error_of_map, left_by_pixels
from capslip.contact.map_curve import BoundaryElementCurve
from capslip.contact.rung import Contacts, Rung, Scene
from capslip.contact.solvers.denoising import without_noise
from capslip.contact.solvers.detail import FirstLoading
from capslip.contact.solvers.elastic_face import ElasticFace, elastic_face
from capslip.contact.solvers.metal import first_loading
from capslip.contact.solvers.nearby import loaded_anew
from capslip.contact.solvers.polonsky_keer import press
from capslip.contact.solvers.pressed import Pressed
from capslip.contact.solvers.refinement import WIDE_ENOUGH
from capslip.contact.solvers.sinking import Sunk, sunk_in
from capslip.contact.solvers.solutions import Solutions
from capslip.contact.solvers.tilting import press_balanced
from capslip.errors import ContactError, SettingsError
from capslip.settings import SOLVER_TOLERANCE
from capslip.surface.heightmap import HeightMap

NAME = "boundary_elements"


def boundary_elements(
    surface: HeightMap,
    E_star_Pa: float,
    tolerance: float = 1e-7,
    *,
    preload_N: float | None = None,
    hardness_Pa: float = math.inf,
    balanced: bool = False,
    load_point_m: tuple[float, float] | None = None,
    rotational_stiffness_Nm_per_rad: float = 0.0,
    at_ease_rad: tuple[float, float] = (0.0, 0.0),
    time_limit_s: float = math.inf,
    noise_m: float | None = None,
) -> BoundaryElementCurve:
    """Return the normal curve of the height map itself: the reference of the other models.

    The map is pressed against a rigid plane, and sinks as an elastic half-space under the pressures
    on it (free boundary). The approach counts from first touch at the highest measured point and
    holds the bulk sinking of the half-space. Non-measured points and what lies outside the map
    never touch.

    The map does not tilt; or it takes the tilt at which a preload balances, and the whole curve is
    that of this tilt held, as slip needs it, with first touch under this tilt.

    Where the map has a hardness, it yields under the preload, and the whole curve is that of the
    elastic map which this first loading leaves: it holds up to the preload.

    Parameters
    ----------
    surface : HeightMap
        Form and spikes off: every point counts.
    E_star_Pa : float
        Composite modulus.
    tolerance : float
        Of every solution, relative to the approach, see `polonsky_keer.press`.
    preload_N : float, optional
        The load under which the map tilts and yields; needed for either.
    hardness_Pa : float
        Greatest pressure that the map bears.
    balanced : bool
        Whether the preload tilts it.
    load_point_m, rotational_stiffness_Nm_per_rad, at_ease_rad
        Of this preload, see `press_balanced`.
    time_limit_s : float
        Of the processor, so that other work on the machine changes no number, by the thread that
        asks alone, so that more cores do not either, and for each preload asked for. A solution
        under it that takes longer is given up, and its slip is followed at as few loads as there is
        time for, with the error that this leaves. What is solved in time does not depend on it.
    noise_m : float, optional
        Measurement noise of the instrument, which is taken off first, see `without_noise`.

    Raises
    ------
    SettingsError, UnusableSurfaceError, ContactError
        As `polonsky_keer.elastic_face`; the methods as `press`, if no solution is found in time.

    Examples
    --------
    >>> y, x = np.mgrid[-40:40, -40:40] * 1e-4
    >>> sphere = HeightMap(-(x**2 + y**2) / (2 * 20.0), (1e-4, 1e-4))
    >>> curve = boundary_elements(sphere, 110e9)
    >>> print(f"{curve.approach_m(10.0):.2e} m")
    6.15e-08 m
    """
    low, high = SOLVER_TOLERANCE
    if not low <= tolerance <= high:
        raise SettingsError(f"solver_tolerance: got {tolerance:g}; expected {low:g} to {high:g}")
    yields = not math.isinf(hardness_Pa)
    if preload_N is None and (balanced or yields):
        raise SettingsError(f"{NAME}: a map tilts and yields under preload_N; got none")
    begun_s = thread_time()
    face = elastic_face(surface, E_star_Pa)
    if noise_m is not None:
        face = without_noise(face, noise_m)
    if preload_N is None or not (balanced or yields):
        return BoundaryElementCurve(Solutions(face, float(tolerance), time_limit_s), NAME)
    face = replace(face, hardness_Pa=float(hardness_Pa))

    def again(face: ElasticFace, near: Pressed | None = None) -> Pressed:
        start_Pa = None if near is None else near.pressure_Pa
        left_s = time_limit_s if near is None else time_limit_s - (thread_time() - begun_s)
        if not balanced:
            return press(
                face,
                load_N=preload_N,
                tolerance=tolerance,
                start_Pa=start_Pa,
                time_limit_s=left_s,
            )
        return press_balanced(
            face,
            preload_N,
            load_point_m,
            rotational_stiffness_Nm_per_rad=rotational_stiffness_Nm_per_rad,
            at_ease_rad=at_ease_rad,
            tolerance=tolerance,
            start_tilt_rad=None if near is None else near.tilt_rad,
            start_Pa=start_Pa,
            time_limit_s=left_s,
        )

    pressed, deeper = sunk_in(face, again(face), again)
    face = face.tilted(pressed.tilt_rad)
    return _unloading(face, pressed, deeper, float(tolerance), time_limit_s, begun_s)


def _after(
    curve: BoundaryElementCurve,
    load_N: float,
    of_load: float,
    of_hardness: float,
    place_m: tuple[float, float] | None = None,
) -> BoundaryElementCurve:
    """Return the curve after another first loading than a known one, by factors.

    Its tilt stays, or is the one at which the other load acts at a place (x, y).
    """
    assert curve.first is not None
    given = (curve.solutions.tolerance, curve.solutions.time_limit_s)
    begun_s, tilt_rad = thread_time(), curve.tilt_rad
    first = curve.first
    if place_m is None:
        pressed, punch = curve.pressed(load_N), curve.solutions.punch(load_N)
        face, again, deeper = loaded_anew(first, pressed, punch, (of_load, of_hardness), *given)
        # Its tilt is that of the pixels: finer points find theirs, as those of the known curve did
        again = replace(again, turns=first.turns)
    else:
        face = replace(first.face, hardness_Pa=of_hardness * first.face.hardness_Pa)
        # It turns a little from load to load: nearly all that touches did under the known one
        known_Pa = curve.pressed(load_N).pressure_Pa
        begin_Pa = np.minimum(of_load * known_Pa, face.hardness_Pa)

        def turned(face: ElasticFace, near: Pressed | None = None) -> Pressed:
            return press_balanced(
                face,
                of_load * load_N,
                place_m,
                tolerance=given[0],
                start_tilt_rad=(0.0, 0.0) if near is None else near.tilt_rad,
                start_Pa=begin_Pa if near is None else near.pressure_Pa,
                time_limit_s=given[1],
            )

        again, deeper = sunk_in(face, turned(first.lowered(face)), turned, first.deeper)
        face = face.tilted(again.tilt_rad)
        tilt_rad = tilt_rad[0] + again.tilt_rad[0], tilt_rad[1] + again.tilt_rad[1]
    after = _unloading(face, again, deeper, *given, begun_s, as_pixels=of_load != 1.0)
    return replace(after, tilt_rad=tilt_rad)


def _unloading(
    face: ElasticFace,
    pressed: Pressed,
    deeper: Sunk | None,
    tolerance: float,
    time_limit_s: float,
    begun_s: float,
    as_pixels: bool = False,
) -> BoundaryElementCurve:
    """Return the curve along which a face unloads from its first load, begun at a `thread_time`.

    It is given before any load, under the tilt of its state, with what it sinks deeper.
    """
    area_m2, first = None, FirstLoading(face, pressed.approach_m, pressed.turns, deeper)
    if not math.isinf(face.hardness_Pa):
        yielded = pressed.pressure_Pa >= face.hardness_Pa
        area_m2 = np.count_nonzero(yielded) * face.pixel_area_m2
        face, pressed = first_loading(first.sunk, pressed)
    spent_s = {pressed.load_N: thread_time() - begun_s}
    solutions = Solutions(face, tolerance, time_limit_s, spent_s, as_pixels=as_pixels)
    solutions.keep(pressed)
    return BoundaryElementCurve(
        solutions, NAME, tilt_rad=pressed.tilt_rad, yielded_area_m2=area_m2, first=first
    )


def _build(scene: Scene) -> BoundaryElementCurve:
    return boundary_elements(
        scene.surface,
        scene.E_star_Pa,
        scene.solver_tolerance,
        preload_N=scene.preload_N,
        hardness_Pa=math.inf if scene.law is None else scene.law.hardness_Pa,
        balanced=not math.isinf(scene.turning_stiffness),
        load_point_m=scene.load_point_m,
        rotational_stiffness_Nm_per_rad=scene.turning_stiffness,
        at_ease_rad=scene.at_ease_rad,
        time_limit_s=scene.time_limit_s,
        noise_m=scene.noise_m,
    )


def _contacts(scene: Scene, curve: BoundaryElementCurve, approach_m: float) -> Contacts:
    pressed = curve.pressed(scene.preload_N)
    n_regions = len(pressed.region_loads_N)
    found = Contacts(
        count=n_regions,
        load_N=np.full(len(scene.caps), np.nan),
        family=np.full(n_regions, ""),
        area_m2=pressed.contact_area_m2,
        yielded_area_m2=curve.yielded_area_m2,
        max_pressure_Pa=pressed.max_pressure_Pa,
        resultant_m=pressed.resultant_m,
        tilt_rad=curve.tilt_rad,
    )
    if pressed.pixels_across >= WIDE_ENOUGH:
        return found
    # Contacts of few pixels are narrower, and bear more in their middle, than pixels tell
    try:
        finer = curve.unloading(scene.preload_N)
    except ContactError:  # slip says why
        return found
    return replace(
        found,
        area_m2=finer.contact_area_m2,
        yielded_area_m2=None if curve.yielded_area_m2 is None else finer.yielded_area_m2,
        max_pressure_Pa=finer.max_pressure_Pa,
    )


def _touching(curve: BoundaryElementCurve, load_N: float) -> int:
    return len(curve.pressed(load_N).region_loads_N)


RUNG = Rung(
    name=NAME,
    label="boundary elements",
    cost=5,
    made_from="map",
    automatic=False,
    holds_bulk=True,
    leaves_out="The height map itself is pressed, without spheres: what its pixels do not resolve "
    "is left out, and the face sinks as part of a half-space that ends nowhere.",
    colour="#009E73",
    interacts=True,
    error=error_of_map,
    problems=BoundaryElementCurve.problems,
    least_share=BoundaryElementCurve.least_share,
    left_by_pixels=left_by_pixels,
    build=_build,
    contacts=_contacts,
    touching=_touching,
    contact_name="contact regions",
    solved_loads_N=BoundaryElementCurve.solved_loads_N,
    tractions=BoundaryElementCurve.tractions,
    near=BoundaryElementCurve.near,
    after=_after,
    at_forces=BoundaryElementCurve.at_forces,
)
