"""The face and its fitted caps in three dimensions, with PyVista.

A picture is rendered by a process of its own, because VTK ends the whole process where it finds no
display or no OpenGL library: `python -m capslip.output.scene RESULT.h5 [PICTURE.png]`, without a
picture as a window.
"""

import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from capslip.errors import OutputError
from capslip.output.canvas import FAMILY_COLOUR, FAMILY_NAME, height_limits
from capslip.output.mesh import cap_mesh, face_mesh

RENDER = (sys.executable, "-P", "-m", "capslip.output.scene")  # -P: no module beside the scans
REMEDY = (
    "3-D pictures need the package pyvista and an OpenGL library "
    "(Debian, Ubuntu: libgl1, libegl1 or libosmesa6; other systems: Mesa)"
)


@dataclass(frozen=True)
class Scene:
    """What the picture shows, read from `result.h5`."""

    height_m: np.ndarray
    pixel_size_m: tuple[float, float]
    x_m: np.ndarray
    y_m: np.ndarray
    peak_height_m: np.ndarray
    cap_height_m: np.ndarray
    diameter_m: np.ndarray
    family: np.ndarray


@dataclass(frozen=True)
class Rendering:
    """A picture under way in a process of its own."""

    process: "subprocess.Popen[str]"
    png: Path

    def wait(self, timeout_s: float = 60.0) -> str | None:
        """Wait for the picture, at most `timeout_s` from now.

        Returns
        -------
        str or None
            None when the picture is there; otherwise one line that says why not and what to
            install.
        """
        try:
            _, stderr = self.process.communicate(timeout=timeout_s)
        except subprocess.TimeoutExpired:
            self.stop()
            return f"the renderer was not ready after {timeout_s:g} s"
        if self.png.is_file():  # renamed when complete: a crash while VTK shuts down does no harm
            return None
        lines = [line.strip() for line in stderr.splitlines() if line.strip()]
        reason = f": {lines[-1][:200]}" if lines else ""
        return f"the renderer ended with code {self.process.returncode}{reason}; {REMEDY}"

    def stop(self) -> None:
        """End the renderer, with or without a picture."""
        self.process.kill()
        self.process.communicate()


def start_render(result: str | Path, png: str | Path, command: Sequence[str] = RENDER) -> Rendering:
    """Start to render a result; `wait()` on what is returned.

    Parameters
    ----------
    result : path
        `result.h5`, or the folder that holds it.
    png : path
        The picture to make; an existing one is removed first.
    command : sequence of str
        The program, called with the two paths.
    """
    png = Path(png)
    png.unlink(missing_ok=True)
    process = subprocess.Popen(
        [*command, str(_file(result)), str(png)],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
    )
    return Rendering(process, png)


def show(result: str | Path) -> None:
    """Open a window with the face and its caps; returns when it is closed.

    Parameters
    ----------
    result : path
        `result.h5`, or the folder that holds it.

    Raises
    ------
    OutputError
        If there is no result, no display, or no OpenGL.
    """
    result = _file(result)
    if not result.is_file():
        raise OutputError(
            f"{result}: no such file; expected the result.h5 of an analysis; give its folder"
        )
    on_x11 = sys.platform not in ("darwin", "win32")
    if on_x11 and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise OutputError(
            f"{result}: no display to open a window on; see figures/scene.png and caps.vtu beside "
            "it, or run under a desktop or xvfb-run"
        )
    done = subprocess.run([*RENDER, str(result)], check=False)
    if done.returncode:
        raise OutputError(f"{result}: the window ended with code {done.returncode}; {REMEDY}")


def _file(result: str | Path) -> Path:
    result = Path(result)
    return result / "result.h5" if result.is_dir() else result


def read_scene(result: str | Path) -> Scene:
    """Read heights and usable caps from `result.h5`."""
    import h5py

    with h5py.File(result) as file:
        height = file["surface/height_m"]
        dy_m, dx_m = (float(size) for size in height.attrs["pixel_size_m"])
        caps = file["caps"]
        usable = np.isfinite(caps["radius_m"][:])
        return Scene(
            height_m=height[:].astype(float),
            pixel_size_m=(dy_m, dx_m),
            x_m=caps["x_m"][:][usable],
            y_m=caps["y_m"][:][usable],
            peak_height_m=caps["peak_height_m"][:][usable],
            cap_height_m=caps["cap_height_m"][:][usable],
            diameter_m=caps["diameter_m"][:][usable],
            family=caps["family"].asstr()[:][usable],
        )


def build_scene(scene: Scene, off_screen: bool = True) -> Any:
    """Place the face, its caps, the legend and the scale in a `pyvista.Plotter`.

    Heights are enlarged by a round factor that makes them a tenth of the face's longer side; the
    caption states it. Lone spikes and pits are drawn at the limit of the bulk and counted there.
    """
    import pyvista

    measured_m = scene.height_m[np.isfinite(scene.height_m)]
    low_m, high_m = height_limits(measured_m, scene.peak_height_m)
    sides_m = [n * size for n, size in zip(scene.height_m.shape, scene.pixel_size_m, strict=True)]
    factor = _round_factor(0.1 * max(sides_m) / (high_m - low_m)) if high_m > low_m else 1.0

    plotter: Any = pyvista.Plotter(off_screen=off_screen, window_size=[1500, 950])
    plotter.set_background("white")
    points, cells = face_mesh(scene.height_m, scene.pixel_size_m)
    face = pyvista.PolyData.from_regular_faces(_enlarged(points, low_m, high_m, factor), cells)
    face["height"] = points[:, 2] * 1e6
    plotter.add_mesh(
        face,
        scalars="height",
        cmap="viridis",
        clim=(low_m * 1e6, high_m * 1e6),
        smooth_shading=True,
        specular=0.15,
        scalar_bar_args={
            "title": "height [µm]\n",
            "vertical": False,
            "position_x": 0.55,
            "position_y": 0.02,
            "height": 0.08,
            "width": 0.42,
            "title_font_size": 18,
            "label_font_size": 16,
            "color": "black",
            "fmt": "%.3g",
        },
    )
    _add_caps(plotter, scene, low_m, high_m, factor)
    clipped = int(((measured_m < low_m) | (measured_m > high_m)).sum())
    plotter.add_text(
        _caption(sides_m, float(np.ptp(measured_m)), factor, clipped),
        position="lower_left",
        font_size=11,
        color="black",
    )
    wide = sides_m[1] >= sides_m[0]  # look across the longer side
    plotter.view_vector((-0.45, -1.0, 0.75) if wide else (1.0, -0.45, 0.75), viewup=(0, 0, 1))
    plotter.camera.zoom(1.35)
    plotter.add_axes(color="black", viewport=(0.86, 0.8, 1.0, 1.0))
    return plotter


def _add_caps(plotter: Any, scene: Scene, low_m: float, high_m: float, factor: float) -> None:
    """Add the caps, slightly lifted, a colour a family, and the legend."""
    import pyvista

    legend = []
    lift_m = 0.01 * (high_m - low_m)
    for name, colour in FAMILY_COLOUR.items():
        member = scene.family == name
        if not member.any():
            continue
        points, cells, _ = cap_mesh(
            scene.x_m[member],
            scene.y_m[member],
            scene.peak_height_m[member],
            scene.cap_height_m[member],
            scene.diameter_m[member],
        )
        points = _enlarged(points, low_m, high_m, factor, lift_m)
        disc = pyvista.PolyData.from_regular_faces(points, cells)
        plotter.add_mesh(disc, color=colour, smooth_shading=True, specular=0.3)
        legend.append((f"{FAMILY_NAME[name]} ({member.sum()})", colour))
    if legend:
        plotter.add_legend(
            legend,
            bcolor="white",
            face="rectangle",
            size=(0.16, 0.035 * len(legend)),
            loc="upper left",
        )


def _enlarged(
    points: np.ndarray, low_m: float, high_m: float, factor: float, lift_m: float = 0.0
) -> np.ndarray:
    """Scale heights, cut at the limits of the picture."""
    z = (np.clip(points[:, 2], low_m, high_m) + lift_m - low_m) * factor
    return np.column_stack([points[:, :2], z])


def _round_factor(factor: float) -> float:
    """Round down to two digits, at least to 1.

    >>> _round_factor(12_834.0)
    12000.0
    """
    digit = 10.0 ** (np.floor(np.log10(factor)) - 1)
    return max(1.0, float(np.floor(factor / digit) * digit))


def _caption(sides_m: list[float], sz_m: float, factor: float, clipped: int) -> str:
    side_y, side_x = (f"{side * 1e3:.3g}" for side in sides_m)
    thousands = f"{factor:,.0f}".replace(",", " ")
    text = f"heights x {thousands}; true scale: {side_x} x {side_y} mm, Sz = {sz_m * 1e6:.3g} µm"
    if clipped:
        text += f"\n{clipped} points beyond the colour scale are drawn at its limits"
    return text


def main(arguments: list[str]) -> None:
    """Render `RESULT.h5` to `PICTURE.png`, or open a window."""
    plotter = build_scene(read_scene(arguments[0]), off_screen=len(arguments) > 1)
    if len(arguments) == 1:
        plotter.show(title=f"capslip: {arguments[0]}")
        return
    png = Path(arguments[1])
    unfinished = png.with_suffix(".part.png")
    plotter.screenshot(unfinished)
    os.replace(unfinished, png)


if __name__ == "__main__":
    main(sys.argv[1:])
