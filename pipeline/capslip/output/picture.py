"""The face and its fitted caps in three dimensions."""

from dataclasses import dataclass

import numpy as np

from capslip.output.canvas import ACCENT, height_limits
from capslip.output.drawing import SHADES, Drawing
from capslip.output.mesh import grid_mesh, segment_mesh
from capslip.output.quantity import engineering, scaled
from capslip.output.view import View, colouring, round_limits
from capslip.output.zones import pixels_at, zone_at

Mesh = tuple[np.ndarray, np.ndarray]  # points, and the corners of cells
WINDOW = (1500, 950)
STICK, SLIP, MATE, RIM = ACCENT, "#CC3311", "#56B4E9", "#808080"
FACE_COLOURS = ("#4a4f57", "#f2f1ee")  # greys, so that colour is that of the caps
LABELLED = 40  # caps, the most loaded
CLOSER = {"caps": -2.0e4, "zones": -3.0e4}  # towards the eye
ASIDE = (0.0, -0.07)  # of the middle of the window: room below for what is said


@dataclass(frozen=True)
class Look:
    """What of a result is shown, and in which state."""

    colour: str = "family"
    load_share: float = 1.0  # normal load over the preload
    force_share: float = 0.0  # tangential force over that at gross slip
    factor: float | None = None  # of the heights; None: a round one
    face: bool = True
    caps: bool = True
    labels: bool = False
    zones: bool = False  # contact, stick and slip
    mate: bool = False  # that at its approach, flat or a second face; the level before the balance

    def two_faces(self, view: View) -> bool:
        """Tell whether two faces are shown, and not their sum."""
        return self.mate and view.second_m is not None

    def limits_of(self, view: View) -> tuple[float, float]:
        """Return the heights that are spanned; what lies beyond is drawn at them."""
        return view.first_limits_m if self.two_faces(view) else view.limits_m

    def factor_of(self, view: View) -> float:
        """Return by how much heights are enlarged."""
        return view.exaggeration(self.limits_of(view)) if self.factor is None else self.factor


def picture_of(view: View, look: Look, drawing: Drawing) -> Drawing:
    """Return a drawing, still empty, that shows a result, seen across its longer side."""
    draw(drawing, view, look)
    wide = view.side_m[1] >= view.side_m[0]
    drawing.look((-0.45, -1.0, 0.75) if wide else (1.0, -0.45, 0.75), up=(0, 0, 1), zoom=1.3)
    drawing.renderer.GetActiveCamera().SetWindowCenter(*ASIDE)
    return drawing


def draw(drawing: Drawing, view: View, look: Look, before: Look | None = None) -> None:
    """Draw a result, or only what differs from the look it was drawn with before."""

    def changed(*names: str) -> bool:
        return before is None or any(getattr(look, n) != getattr(before, n) for n in names)

    state = ("load_share", "force_share")
    heights = () if view.second_m is None else ("mate",)
    if changed("face", *heights):
        _draw_face(drawing, view, look)
    if changed("caps", "colour", *heights):
        _draw_caps(drawing, view, look)
    if changed("labels", "factor", *heights):
        _draw_labels(drawing, view, look)
    if changed("zones", *state, *heights):
        _draw_zones(drawing, view, look)
    if changed("mate", "load_share"):
        _draw_mate(drawing, view, look, anew=changed("mate"))
    drawing.stretch(look.factor_of(view))
    drawing.words("caption", caption(view, look))


def caption(view: View, look: Look) -> str:
    """Return what the picture says of itself: scale, state and what was cut off."""
    side_y, side_x = (f"{side * 1e3:.3g}" for side in view.side_m)
    measured_m = view.first_m if look.two_faces(view) else view.height_m
    measured_m = measured_m[np.isfinite(measured_m)]
    low_m, high_m = look.limits_of(view)
    factor = look.factor_of(view)
    enlarged = f"{factor:,.0f}".replace(",", " ") if factor >= 10.0 else f"{factor:.2g}"
    sz_m = float(np.ptp(measured_m)) if look.two_faces(view) else view.sz_m
    sz = engineering(float(f"{sz_m:.1e}"), "m")  # over the balanced plane, so about
    lines = [f"heights x {enlarged}; true scale: {side_x} x {side_y} mm, about {sz} high"]
    clipped = float(((measured_m < low_m) | (measured_m > high_m)).mean())
    if clipped > 0.0:
        lines.append(f"{100.0 * clipped:.2g} % of the points lie beyond and are drawn at the limit")
    if look.two_faces(view):
        lines.append("both faces, the second to be seen through; caps are those of their sum")
    if look.zones and view.zones is not None:
        lines.append(state_line(view, look))
        lines += [view.enlarged_points] if view.enlarged_points else []
    contact = view.summary.get("contact") or {}
    if look.mate and view.zones is None:
        where = "the mate is where it first touches" if contact else "no mate is drawn"
        lines.append(f"no single contacts are known: {where}")
    tilt_m = contact.get("tilt_across_face_m")
    if look.mate and tilt_m:
        lines.append(f"balanced: turned by {engineering(tilt_m, 'm')} across the face")
    return "\n".join(lines)


def state_line(view: View, look: Look) -> str:
    """Return the state of the contacts in words.

    Regions of a map fall apart as the load falls, and what touches then is near what a solution
    has: so area comes first, and it is about.
    """
    zones = view.zones
    assert zones is not None
    state = zone_at(zones, look.load_share, look.force_share)
    n = {word: int((state.word == word).sum()) for word in ("sticks", "slips in part", "slips")}
    touching = f"of {sum(n.values())} caps in contact"
    if zones.of_map:
        touch, stick = (int(each.sum()) for each in pixels_at(zones, state))
        area_mm2 = touch * float(zones.pixel_area_m2[0]) * 1e6
        touching = (
            f"about {area_mm2:.3g} mm² touch, {100.0 * stick / max(touch, 1):.0f} % of it sticks;\n"
            f"of {len(zones)} regions under the preload about {sum(n.values())} touch:"
        )
    return (
        f"{engineering(look.load_share * zones.load_N[-1], 'N')} on the scan, force "
        f"{100.0 * look.force_share:.0f} % of gross slip:\n{touching} {n['sticks']} stick, "
        f"{n['slips in part']} slip in part, {n['slips']} slip (green sticks, red slips)"
    )


def _draw_face(drawing: Drawing, view: View, look: Look) -> None:
    drawing.remove("face", "heights")
    if not look.face:
        return
    points, cells = grid_mesh(view.height_m, view.y_m, view.x_m)
    if not len(cells):
        return
    points = _placed(view, look, points)
    height, unit = scaled(points[:, 2] + look.limits_of(view)[0], "m")
    drawing.surface(
        "face",
        points,
        cells,
        values=height,
        colours=_shades(*FACE_COLOURS),
        limits=round_limits(height),
        specular=0.1,
    )
    drawing.bar("heights", "face", f"height [{unit}]", (0.56, 0.02), 0.4)


def _draw_caps(drawing: Drawing, view: View, look: Look) -> None:
    drawing.remove("caps", "kinds", "colours")
    if not look.caps or not len(view.cap):
        return
    of = view.columns
    apex_m = np.stack([of["x_m"], of["y_m"], of["peak_height_m"]], axis=1)
    depth_m = np.minimum(of["cap_height_m"], of["radius_m"])  # down to the cut, or the equator
    base_m = np.sqrt(depth_m * (2.0 * of["radius_m"] - depth_m))
    base_m = np.minimum(base_m, 0.5 * of["diameter_m"])
    points, cells, cap = segment_mesh(apex_m, of["radius_m"], 0.0 * base_m, base_m, view.side_m)
    colours = colouring(view, look.colour)
    named = [colour for _, colour in colours.names]
    drawing.surface(
        "caps",
        _placed(view, look, points),
        cells,
        values=colours.value[cap],
        colours=named or _plasma(),
        limits=(-0.5, len(named) - 0.5) if named else colours.limits,
        specular=0.3,
        closer=CLOSER["caps"],
    )
    if named:
        drawing.legend("kinds", colours.names)
    else:
        drawing.bar("colours", "caps", colours.title, (0.03, 0.88), 0.3)


def _shades(first: str, last: str) -> list[str]:
    """Return the colours from one to another."""
    ends = np.array([list(bytes.fromhex(one[1:])) for one in (first, last)])
    between = ends[0] + np.linspace(0.0, 1.0, SHADES)[:, None] * (ends[1] - ends[0])
    return [f"#{bytes(row).hex()}" for row in between.round().astype(np.uint8)]


def _plasma() -> list[str]:
    from matplotlib import colormaps
    from matplotlib.colors import to_hex

    return [to_hex(colour) for colour in colormaps["plasma"](np.arange(SHADES))]


def _draw_labels(drawing: Drawing, view: View, look: Look) -> None:
    drawing.remove("labels")
    if not look.labels or not len(view.cap):
        return
    of = view.columns
    order = np.lexsort((-of["peak_height_m"], -view.cap_load_N))[:LABELLED]
    places_m = np.stack([of[name][order] for name in ("x_m", "y_m", "peak_height_m")], axis=1)
    places_m = _placed(view, look, places_m) * (1.0, 1.0, look.factor_of(view))
    drawing.labels("labels", places_m, [str(view.cap[i] + 1) for i in order], size_pt=14)


def _draw_zones(drawing: Drawing, view: View, look: Look) -> None:
    drawing.remove("stick", "slip")
    if not look.zones or view.zones is None:
        return
    parts = _pixels(view, look) if view.zones.of_map else _rings(view, look)
    for name, colour in (("stick", STICK), ("slip", SLIP)):
        points, cells = parts[name]
        lit = not view.zones.of_map
        drawing.surface(name, points, cells, colour, lit=lit, closer=CLOSER["zones"])


def _rings(view: View, look: Look) -> dict[str, Mesh]:
    """Return a disc that sticks and a ring that slips on each cap in contact."""
    zones = view.zones
    assert zones is not None
    state = zone_at(zones, look.load_share, look.force_share)
    at = np.searchsorted(view.cap, zones.cap)
    of = view.columns
    touch_m, stick_m = zones.radius_m * state.contact, zones.radius_m * state.stick
    found = {}
    for name, inner_m, outer_m in (("stick", 0.0 * stick_m, stick_m), ("slip", stick_m, touch_m)):
        seen = outer_m > inner_m
        i = at[seen]
        apex_m = np.stack([of["x_m"][i], of["y_m"][i], of["peak_height_m"][i]], axis=1)
        rings = inner_m[seen], outer_m[seen]
        points, cells, _ = segment_mesh(apex_m, of["radius_m"][i], *rings, view.side_m)
        found[name] = _placed(view, look, points), cells
    return found


def _pixels(view: View, look: Look) -> dict[str, Mesh]:
    """Return the contact pixels of a map as squares of their size, or of one that is seen."""
    zones = view.zones
    assert zones is not None
    state = zone_at(zones, look.load_share, look.force_share)
    touch, stick = pixels_at(zones, state)
    middle = _placed(view, look, view.pixel_m)
    corner = 0.5 * view.point_side_m * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
    found = {}
    for name, at in (("stick", stick), ("slip", touch & ~stick)):
        points = (middle[at, None] + corner).reshape(-1, 3)
        found[name] = points, np.arange(len(points)).reshape(-1, 4)
    return found


def _draw_mate(drawing: Drawing, view: View, look: Look, anew: bool) -> None:
    """Draw the mate at its approach, and the outline of the level before the balance.

    A second face is as large as the first: unless `anew`, the one that is drawn goes up or down.
    """
    drawing.remove("rim", "level", *(("mate",) if anew else ()))
    if not look.mate or not view.summary.get("contact"):
        return
    contact, low_m = view.summary["contact"], look.limits_of(view)[0]
    top_m = _top_m(view) - view.approach_at(look.load_share) - low_m
    ly_m, lx_m = view.side_m
    corners = np.array([(0.0, 0.0), (lx_m, 0.0), (lx_m, ly_m), (0.0, ly_m)])
    if view.second_m is not None:
        if anew:
            under_m = np.where(np.isnan(view.height_m), np.nan, -view.second_m)
            low_m, high_m = height_limits(view.second_m)
            under_m = np.clip(under_m, -high_m, -low_m)
            drawing.surface("mate", *grid_mesh(under_m, view.y_m, view.x_m), MATE, opacity=0.35)
        drawing.lifts["mate"] = top_m
    else:
        flat = np.column_stack([corners, np.full(4, top_m)])
        drawing.surface("mate", flat, np.array([[0, 1, 2, 3]]), MATE, opacity=0.35)
        drawing.line("rim", flat[[0, 1, 2, 3, 0]], RIM)
    if contact.get("tilt_rad") and any(contact["tilt_rad"]):
        turned_m = (corners - 0.5 * corners[2]) @ np.array(contact["tilt_rad"])
        ring = np.column_stack([corners, top_m + turned_m])[[0, 1, 2, 3, 0]]
        drawing.line("level", ring, SLIP, width=2.0)


def _top_m(view: View) -> float:
    """Return the height at which a flat mate first touches."""
    if view.zones is not None and view.zones.of_map:
        return float(view.pixel_m[:, 2].max())
    return float(view.columns["peak_height_m"].max(initial=view.limits_m[0]))


def _placed(view: View, look: Look, points: np.ndarray) -> np.ndarray:
    """Return points with heights from the lowest shown, cut at the limits.

    Where two faces are shown, what lies on their sum comes down on the first: by the heights of the
    second, which meets it there as the sum meets a flat.
    """
    x_m, y_m, z_m = points.T
    if look.two_faces(view):
        z_m = z_m - view.second_at(x_m, y_m)
    low_m, high_m = look.limits_of(view)
    return np.stack([x_m, y_m, np.clip(z_m, low_m, high_m) - low_m], axis=1)
