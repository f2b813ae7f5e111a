"""What is said of the detail, the pixels and the noise of a map that is pressed itself."""

import math
from dataclasses import replace

from capslip.contact.solvers.detail import WHITE_LEFT, Detail
from capslip.contact.solvers.elastic_face import TakenNoise
from capslip.problems import Effect, Problem, Severity
from capslip.units import off_by, percent, share_of

S_FILTER, NOISE_PIXELS = "conditioning.s_filter_nesting_index_m", 5.0  # what takes noise off
TELLS_NOISE = (
    "capslip average with another scan of this place, or --set instrument.noise_m=..., tells noise "
    "from detail"
)
RESOLVED = 0.1  # of what the filter takes, that noise may be: 0.01 on smooth faces, noise 0.3 to 1
BLURRED = "resolution_decides"
BLUR = "the optics halve waves of {:.3g} m, and blur longer ones, too"
LEAST_MOVED = 1e-3  # of stiffness and energy: less that the optics move is not noted
ASKED = 0.25  # of mu N, from which pixels and noise that move the energy warn; below, a note


def of_detail(
    detail: Detail,
    of_pixels: float,
    tolerance: float,
    pixel_m: float,
    noise_known: bool,
    share: float = ASKED,
    filtered: bool = False,
) -> list[Problem]:
    """Return what there is to say of the finest detail.

    Of that as much is doubted as may be of white noise: noise moves more than the filter takes off
    of it, and what changes less from pixel to pixel than noise does is the face's own. Where a
    share of mu N beyond a quarter is asked for, the effect is that from there on.
    """
    effect = detail.effect
    if effect.greatest <= tolerance:
        return []
    said = (
        f"detail of a few pixels moves the stiffness by {effect.tangential_stiffness:.1%} and the "
        f"energy by up to {effect.energy:.1%}"
    )
    asked = detail.energy_at(share)
    if share > ASKED:
        effect = replace(effect, energy=asked, loss_factor=asked)
    if of_pixels <= tolerance and detail.white_share < RESOLVED:
        message = f"{said}, and is smooth from pixel to pixel: it is taken for the face's own"
        return [Problem("detail_decides", "info", message, effect)]
    if (most := doubted_of(detail) * max(effect.tangential_stiffness or 0.0, asked)) <= tolerance:
        message = (
            f"{said}, by no more than {asked:.1%} from {percent(share)} of gross slip on; noise as "
            f"its differences from pixel to pixel allow moves up to {most:.1%} there"
        )
        return [Problem("detail_decides", "info", message, effect)]
    if share > ASKED:
        said += f", and that by {asked:.1%} from {percent(share)} of gross slip on"
    message = f"{said}: noise, spikes, lost points or roughness that the map hardly resolves"
    ways = [] if noise_known else [TELLS_NOISE]
    if not filtered:
        of_filter = f"--set {S_FILTER}={NOISE_PIXELS * pixel_m:.2g}, if the detail is noise"
        ways.append("or " * bool(ways) + of_filter)
    if of_pixels <= max(tolerance, asked):
        ways.append("else a finer scan" if ways else "Scan with smaller pixels.")
    else:
        left = f"{off_by(of_pixels)} in the energy at {percent(share)} of gross slip"
        message += f"; pixels leave up to {left}"
        ways.insert(0, unresolved("warning", share, of_pixels).advice)
        energy = max(effect.energy or 0.0, share_of(of_pixels))
        effect = replace(effect, energy=energy, loss_factor=energy)
    return [Problem("detail_decides", "warning", message, effect, "; ".join(ways))]


def of_resolution(blur: Detail, tolerance: float, period_m: float) -> list[Problem]:
    """Return what the optics may have moved that halve waves of a period; below a thousandth, none.

    What moves is given as logarithms.
    """
    stiffness, energy = blur.effect.tangential_stiffness or 0.0, blur.effect.energy or 0.0
    if max(stiffness, energy) < LEAST_MOVED:
        return []
    severity: Severity = "warning" if max(stiffness, energy) > tolerance else "info"
    message = (
        f"{BLUR.format(period_m)}: as one more such blur tells, that has moved the stiffness by up "
        f"to {off_by(stiffness)} and the energy by up to {off_by(energy)}"
    )
    moved = share_of(energy)
    effect = Effect(share_of(stiffness), moved, moved)
    return [Problem(BLURRED, severity, message, effect)]


def doubted_of(detail: Detail) -> float:
    """Return what may be in error of what detail moves, over that."""
    return detail.white_share / (1.0 - WHITE_LEFT)


def unresolved(severity: Severity, share: float, error: float) -> Problem:
    """Return what pixels and noise leave at a share of mu N."""
    message = (
        f"at {percent(share)} of the force at gross slip pixels and noise of the map leave up to "
        f"{off_by(error)} in the energy per cycle"
    )
    moved, step = share_of(error), None if share < 1.0 else "Scan with smaller pixels."
    effect = Effect(None, moved, moved)
    return Problem("small_slip_extrapolated", severity, message, effect, step)


def less_noise(
    too_much: float,
    taken: TakenNoise | None,
    pixel_m: float,
    white_m: float | None = None,
    faces: float = 1,
    filtered: bool = False,
) -> str:
    """Return what to do about noise that does so many times what it may, or may be no noise.

    The setting is the noise of one scan, of which two faces have two, less what interpolation
    takes off.
    """
    scans = max(2, math.ceil(too_much**2))
    less = f"average {scans} scans (capslip average)"
    if taken is not None:
        noise_m = taken.noise_m / math.sqrt(scans * faces)
        return f"{less}, with --set instrument.noise_m={noise_m:.2g}"
    if not filtered:
        less = f"--set {S_FILTER}={NOISE_PIXELS * pixel_m:.2g}, or {less}"
    if white_m is None:
        return less
    noise_m = white_m / math.sqrt(faces)
    return f"--set instrument.noise_m={noise_m:.2g}, if the instrument has as much; else {less}"


def noisy(
    noise: str,
    of_noise: float,
    of_pixels: float,
    tolerance: float,
    less: str,
    share: float = ASKED,
) -> Problem:
    """Return what noise leaves at a share of mu N, with its pixels where these leave much."""
    moved = share_of(math.hypot(of_noise, of_pixels))
    message = (
        f"{noise} leaves up to {off_by(of_noise)} in the energy per cycle "
        f"at {percent(share)} of the force at gross slip"
    )
    if of_pixels > tolerance:
        message += f", and its pixels up to {off_by(of_pixels)}"
    step = unresolved("warning", share, of_pixels).advice if of_pixels > of_noise else less
    return Problem("detail_decides", "warning", message, Effect(None, moved, moved), step)
