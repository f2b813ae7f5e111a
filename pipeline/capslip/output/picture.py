"""The face and its fitted caps in three dimensions, drawn with PyVista."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from capslip.output.canvas import ACCENT
from capslip.output.mesh import grid_mesh, segment_mesh
from capslip.output.quantity import engineering, scaled
from capslip.output.view import View, colouring, round_limits
from capslip.output.zones import zone_at

WINDOW = (1500, 950)
STICK, SLIP, MATE = ACCENT, "#CC3311", "#56B4E9"
FACE_COLOURS = ("#4a4f57", "#f2f1ee")  # greys, so that colour is that of the caps
LABELLED = 40  # caps, the most loaded
# How far towards the eye a part is drawn, so that parts that coincide do not speckle
LINE_SPACING = 1.25  # of the caption: VTK's own lets lines touch
CLOSER = {"caps": -2.0e4, "zones": -3.0e4}
NORMALS = {  # of points, so that a surface looks smooth; triangles are in order as they are
    "cell_normals": False,
    "consistent_normals": False,
    "split_vertices": False,
    "non_manifold_traversal": False,
}


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
    mate: bool = False  # the flat mate at its approach, and the level before the balance

    def factor_of(self, view: View) -> float:
        """Return by how much heights are enlarged."""
        return view.exaggeration if self.factor is None else self.factor


def plotter_of(view: View, look: Look, off_screen: bool = True) -> Any:
    """Return a `pyvista.Plotter` that shows a result, seen across its longer side."""
    import pyvista

    pyvista.global_theme.allow_empty_mesh = True
    plotter: Any = pyvista.Plotter(off_screen=off_screen, window_size=list(WINDOW))
    plotter.set_background("white")
    draw(plotter, view, look)
    wide = view.side_m[1] >= view.side_m[0]
    plotter.view_vector((-0.45, -1.0, 0.75) if wide else (1.0, -0.45, 0.75), viewup=(0, 0, 1))
    plotter.camera.zoom(1.3)
    plotter.camera.SetWindowCenter(0.0, -0.07)  # room below for what is said
    plotter.add_axes(color="black", viewport=(0.0, 0.1, 0.12, 0.28))
    return plotter


def draw(plotter: Any, view: View, look: Look, before: Look | None = None) -> None:
    """Draw a result, or only what differs from the look it was drawn with before."""

    def changed(*names: str) -> bool:
        return before is None or any(getattr(look, n) != getattr(before, n) for n in names)

    state = ("load_share", "force_share")
    if changed("face"):
        _draw_face(plotter, view, look)
    if changed("caps", "colour"):
        _draw_caps(plotter, view, look)
    if changed("labels", "factor"):
        _draw_labels(plotter, view, look)
    if changed("zones", *state):
        _draw_zones(plotter, view, look)
    if changed("mate", "load_share"):
        _draw_mate(plotter, view, look)
    for actor in plotter.actors.values():
        if hasattr(actor, "SetScale"):
            actor.SetScale(1.0, 1.0, look.factor_of(view))
    text = plotter.add_text(
        caption(view, look),
        position="lower_left",
        font_size=11,
        color="black",
        name="caption",
        render=False,
    )
    text.prop.SetLineSpacing(LINE_SPACING)


def caption(view: View, look: Look) -> str:
    """Return what the picture says of itself: scale, state and what was cut off."""
    side_y, side_x = (f"{side * 1e3:.3g}" for side in view.side_m)
    measured_m = view.height_m[np.isfinite(view.height_m)]
    low_m, high_m = view.limits_m
    factor = look.factor_of(view)
    enlarged = f"{factor:,.0f}".replace(",", " ") if factor >= 10.0 else f"{factor:.2g}"
    sz = engineering(float(f"{view.sz_m:.1e}"), "m")  # over the balanced plane, so about
    lines = [f"heights x {enlarged}; true scale: {side_x} x {side_y} mm, about {sz} high"]
    clipped = float(((measured_m < low_m) | (measured_m > high_m)).mean())
    if clipped > 0.0:
        lines.append(f"{100.0 * clipped:.2g} % of the points lie beyond and are drawn at the limit")
    if look.zones and view.zones is not None:
        lines.append(state_line(view, look))
        lines += [view.enlarged_points] if view.enlarged_points else []
    tilt_m = (view.summary.get("contact") or {}).get("tilt_across_face_m")
    if look.mate and tilt_m:
        lines.append(f"balanced: turned by {engineering(tilt_m, 'm')} across the face")
    return "\n".join(lines)


def state_line(view: View, look: Look) -> str:
    """Return the state of the contacts in words."""
    assert view.zones is not None
    words = zone_at(view.zones, look.load_share, look.force_share).word
    load_N = look.load_share * view.zones.load_N[-1]
    n = {word: int((words == word).sum()) for word in ("sticks", "slips in part", "slips")}
    what = "contact regions" if view.zones.of_map else "caps"
    return (
        f"{engineering(load_N, 'N')} on the scan, force {100.0 * look.force_share:.0f} % of gross "
        f"slip:\nof {sum(n.values())} {what} in contact {n['sticks']} stick, "
        f"{n['slips in part']} slip in part, {n['slips']} slip (green sticks, red slips)"
    )


def _draw_face(plotter: Any, view: View, look: Look) -> None:
    import pyvista
    from matplotlib.colors import LinearSegmentedColormap

    plotter.remove_actor("face", render=False)
    if "face" in plotter.scalar_bars:
        plotter.remove_scalar_bar("face", render=False)
    if not look.face:
        return
    low_m, high_m = view.limits_m
    points, cells = grid_mesh(view.height_m, view.y_m, view.x_m)
    face = pyvista.PolyData.from_regular_faces(_placed(points, low_m, high_m), cells)
    height, unit = scaled(np.clip(points[:, 2], low_m, high_m), "m")
    title = f"height [{unit}]"
    face["height"] = height
    face = face.compute_normals(**NORMALS)
    plotter.add_mesh(
        face,
        name="face",
        scalars="height",
        cmap=LinearSegmentedColormap.from_list("face", FACE_COLOURS),
        clim=round_limits(height),
        specular=0.1,
        smooth_shading=True,
        split_sharp_edges=False,
        show_scalar_bar=False,
        render=False,
    )
    _scalar_bar(plotter, title, "face", plotter.actors["face"].mapper, 0.56)


def _draw_caps(plotter: Any, view: View, look: Look) -> None:
    import pyvista

    plotter.remove_actor("caps", render=False)
    plotter.remove_legend(render=False)
    if "caps" in plotter.scalar_bars:
        plotter.remove_scalar_bar("caps", render=False)
    if not look.caps or not len(view.cap):
        return
    of, low_m = view.columns, view.limits_m[0]
    apex_m = np.stack([of["x_m"], of["y_m"], of["peak_height_m"] - low_m], axis=1)
    depth_m = np.minimum(of["cap_height_m"], of["radius_m"])  # down to the cut, or the equator
    base_m = np.sqrt(depth_m * (2.0 * of["radius_m"] - depth_m))
    base_m = np.minimum(base_m, 0.5 * of["diameter_m"])
    points, cells, cap = segment_mesh(apex_m, of["radius_m"], 0.0 * base_m, base_m, view.side_m)
    points[:, 2] = np.maximum(points[:, 2], 0.0)
    mesh = pyvista.PolyData.from_regular_faces(points, cells)
    colours = colouring(view, look.colour)
    mesh["value"] = colours.value[cap]
    mesh = mesh.compute_normals(**NORMALS)
    how: dict[str, Any] = {"cmap": "plasma", "clim": colours.limits}
    if colours.names:
        how = {
            "cmap": [colour for _, colour in colours.names],
            "clim": (-0.5, len(colours.names) - 0.5),
        }
    actor = plotter.add_mesh(
        mesh,
        name="caps",
        scalars="value",
        specular=0.3,
        smooth_shading=True,
        split_sharp_edges=False,
        show_scalar_bar=False,
        render=False,
        **how,
    )
    _closer(actor, "caps")
    if colours.names:
        plotter.add_legend(
            [*colours.names],
            bcolor="white",
            face="rectangle",
            size=(0.2, 0.035 * len(colours.names)),
            loc="upper left",
        )
    else:
        _scalar_bar(plotter, colours.title, "caps", actor.mapper, 0.1)


def _draw_labels(plotter: Any, view: View, look: Look) -> None:
    plotter.remove_actor("labels", render=False)
    plotter.remove_actor("labels-labels", render=False)
    if not look.labels or not len(view.cap):
        return
    of, low_m = view.columns, view.limits_m[0]
    order = np.lexsort((-of["peak_height_m"], -view.cap_load_N))[:LABELLED]
    z_m = (of["peak_height_m"][order] - low_m) * look.factor_of(view)
    plotter.add_point_labels(
        np.stack([of["x_m"][order], of["y_m"][order], z_m], axis=1),
        [str(view.cap[i] + 1) for i in order],
        name="labels",
        font_size=14,
        text_color="black",
        shape_opacity=0.6,
        show_points=False,
        always_visible=True,
        reset_camera=False,
        render=False,
    )


def _draw_zones(plotter: Any, view: View, look: Look) -> None:
    for name in ("stick", "slip"):
        plotter.remove_actor(name, render=False)
    if not look.zones or view.zones is None:
        return
    parts = _pixels(view, look) if view.zones.of_map else _rings(view, look)
    for name, mesh in parts.items():
        if mesh.n_points:
            colour = {"stick": STICK, "slip": SLIP}[name]
            lit = not view.zones.of_map
            actor = plotter.add_mesh(mesh, name=name, color=colour, lighting=lit, render=False)
            _closer(actor, "zones")


def _rings(view: View, look: Look) -> dict[str, Any]:
    """Return a disc that sticks and a ring that slips on each cap in contact."""
    import pyvista

    zones = view.zones
    assert zones is not None
    state = zone_at(zones, look.load_share, look.force_share)
    at = np.searchsorted(view.cap, zones.cap)
    of, low_m = view.columns, view.limits_m[0]
    touch_m, stick_m = zones.radius_m * state.contact, zones.radius_m * state.stick
    found = {}
    for name, inner_m, outer_m in (("stick", 0.0 * stick_m, stick_m), ("slip", stick_m, touch_m)):
        seen = outer_m > inner_m
        i = at[seen]
        apex_m = np.stack([of["x_m"][i], of["y_m"][i], of["peak_height_m"][i] - low_m], axis=1)
        rings = inner_m[seen], outer_m[seen]
        points, cells, _ = segment_mesh(apex_m, of["radius_m"][i], *rings, view.side_m)
        mesh = pyvista.PolyData()
        found[name] = pyvista.PolyData.from_regular_faces(points, cells) if len(i) else mesh
    return found


def _pixels(view: View, look: Look) -> dict[str, Any]:
    """Return the contact pixels of a map as squares of their size, or of one that is seen."""
    import pyvista

    zones, (low_m, high_m) = view.zones, view.limits_m
    assert zones is not None
    state = zone_at(zones, look.load_share, look.force_share)
    reach = zones.pixel_reach
    touch = reach <= state.contact[zones.pixel_contact] * (1.0 + 1e-9)
    touch &= state.contact[zones.pixel_contact] > 0.0
    stick = touch & (reach <= state.stick[zones.pixel_contact])
    stick &= state.stick[zones.pixel_contact] > 0.0
    middle = _placed(view.pixel_m, low_m, high_m)
    corner = 0.5 * view.point_side_m * np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
    found = {}
    for name, at in (("stick", stick), ("slip", touch & ~stick)):
        points = (middle[at, None] + corner).reshape(-1, 3)
        cells: Any = np.arange(len(points)).reshape(-1, 4)
        mesh = pyvista.PolyData()
        found[name] = pyvista.PolyData.from_regular_faces(points, cells) if at.any() else mesh
    return found


def _draw_mate(plotter: Any, view: View, look: Look) -> None:
    """Draw the flat mate at its approach, and the outline of the level before the balance."""
    import pyvista

    for name in ("mate", "level"):
        plotter.remove_actor(name, render=False)
    if not look.mate or not view.summary.get("contact"):
        return
    contact, low_m = view.summary["contact"], view.limits_m[0]
    top_m = _top_m(view) - view.approach_at(look.load_share) - low_m
    ly_m, lx_m = view.side_m
    corners = np.array([(0.0, 0.0), (lx_m, 0.0), (lx_m, ly_m), (0.0, ly_m)])
    flat = np.column_stack([corners, np.full(4, top_m)])
    quad = pyvista.PolyData.from_regular_faces(flat, np.array([[0, 1, 2, 3]]))
    plotter.add_mesh(quad, name="mate", color=MATE, opacity=0.35, show_edges=True, render=False)
    if contact.get("tilt_rad") and any(contact["tilt_rad"]):
        turned_m = (corners - 0.5 * corners[2]) @ np.array(contact["tilt_rad"])
        ring = np.column_stack([corners, top_m + turned_m])[[0, 1, 2, 3, 0]]
        line = pyvista.lines_from_points(ring)
        plotter.add_mesh(line, name="level", color=SLIP, line_width=2, render=False)


def _top_m(view: View) -> float:
    """Return the height at which a flat mate first touches."""
    if view.zones is not None and view.zones.of_map:
        return float(view.pixel_m[:, 2].max())
    return float(view.columns["peak_height_m"].max(initial=view.limits_m[0]))


def _scalar_bar(plotter: Any, title: str, name: str, mapper: Any, x: float) -> None:
    bar = plotter.add_scalar_bar(
        title=name,  # under which it is found again
        mapper=mapper,
        vertical=False,
        position_x=x if name == "face" else 0.03,
        position_y=0.02 if name == "face" else 0.88,
        height=0.08,
        width=0.4 if name == "face" else 0.3,
        n_labels=3,
        title_font_size=18,
        label_font_size=16,
        color="black",
        fmt="%.3g",
        render=False,
    )
    bar.SetTitle(f"{title}\n")


def _closer(actor: Any, part: str) -> None:
    mapper = actor.mapper
    mapper.SetResolveCoincidentTopologyToPolygonOffset()
    mapper.SetRelativeCoincidentTopologyPolygonOffsetParameters(0.0, CLOSER[part])
    mapper.SetRelativeCoincidentTopologyPointOffsetParameter(CLOSER[part])


def _placed(points: np.ndarray, low_m: float, high_m: float) -> np.ndarray:
    """Return points with heights from the lowest shown, cut at the limits."""
    placed: np.ndarray = points.copy()
    placed[:, 2] = np.clip(points[:, 2], low_m, high_m) - low_m
    return placed
