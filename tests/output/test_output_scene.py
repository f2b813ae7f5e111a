"""Three-dimensional picture: its content, and every way it can fail."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import output_cases
import pytest

from capslip.errors import OutputError
from capslip.output.scene import read_scene, show, start_render
from capslip.output.tables import write_result

DRAW_A_SPHERE = (
    "import sys, pyvista\n"
    "plotter = pyvista.Plotter(off_screen=True)\n"
    "plotter.add_mesh(pyvista.Sphere())\n"
    "plotter.screenshot(sys.argv[1])"
)


def python(code):
    return (sys.executable, "-c", code)


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    folder = tmp_path_factory.mktemp("result")
    write_result(output_cases.several(), folder)
    return folder


@pytest.fixture(scope="module")
def opengl(tmp_path_factory):
    """Skip where VTK alone cannot render, which is no fault of this project."""
    png = tmp_path_factory.mktemp("sphere") / "sphere.png"
    subprocess.run([*python(DRAW_A_SPHERE), str(png)], capture_output=True, check=False)
    if not png.is_file():
        pytest.skip("VTK finds no OpenGL here")


def test_scene_holds_the_result(result, several):
    scene, analysis = read_scene(result / "result.h5"), several
    surface = analysis.conditioned.surface
    np.testing.assert_allclose(scene.height_m, surface.height_m, rtol=1e-6, atol=1e-13)
    assert scene.pixel_size_m == pytest.approx(surface.pixel_size_m)
    assert list(scene.family) == list(analysis.caps.family)
    np.testing.assert_array_equal(scene.diameter_m, analysis.caps.diameter_m)


def test_cap_without_a_sphere_is_left_out(several, tmp_path):
    radius_m = several.caps.radius_m.copy()
    radius_m[1] = np.nan
    write_result(replace(several, caps=several.caps.with_columns(radius_m=radius_m)), tmp_path)
    assert len(read_scene(tmp_path / "result.h5").x_m) == len(several.caps) - 1


@pytest.mark.parametrize("file", ["", "result.h5"])
def test_picture_shows_both_families(opengl, result, tmp_path, file):
    from matplotlib.image import imread

    png = tmp_path / "scene.png"
    message = start_render(result / file, png).wait(timeout_s=120)
    assert message is None
    red, green, blue = imread(png)[..., :3].transpose(2, 0, 1)
    assert (red + green + blue > 2.99).mean() > 0.3  # white paper
    assert ((red > 0.5) & (green < 0.5) & (blue < 0.2)).sum() > 500  # vermilion
    assert ((red < 0.2) & (green < 0.6) & (blue > 0.5)).sum() > 500  # blue
    assert [path.name for path in tmp_path.iterdir()] == ["scene.png"]


def test_face_without_caps_can_be_rendered(opengl, none, tmp_path):
    write_result(none, tmp_path)
    assert start_render(tmp_path, tmp_path / "scene.png").wait(timeout_s=120) is None


@pytest.mark.parametrize(
    ("code", "said"),
    [
        ("import os; os.abort()", "code -6"),
        ("import sys; sys.exit('no GL context')", "no GL context"),
        ("raise ImportError('No module named pyvista')", "No module named pyvista"),
    ],
)
def test_renderer_that_dies_leaves_one_line(result, tmp_path, code, said):
    png = tmp_path / "scene.png"
    png.write_bytes(b"an older picture")
    message = start_render(result, png, python(code)).wait()
    assert said in message
    assert "libgl1" in message
    assert "\n" not in message
    assert not png.exists()


def test_renderer_that_hangs_is_ended(result, tmp_path):
    rendering = start_render(result, tmp_path / "scene.png", python("import time; time.sleep(60)"))
    assert "after 0.5 s" in rendering.wait(timeout_s=0.5)
    assert rendering.process.returncode is not None


def test_crash_after_the_picture_is_no_loss(result, tmp_path):
    code = "import os, sys; open(sys.argv[2], 'wb').write(b'picture'); os.abort()"
    assert start_render(result, tmp_path / "scene.png", python(code)).wait() is None


def test_window_without_a_display_is_one_clear_line(result, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(OutputError, match=r"no display.*scene\.png"):
        show(result)


def test_window_needs_a_result(tmp_path):
    with pytest.raises(OutputError, match=r"expected the result\.h5"):
        show(tmp_path)
