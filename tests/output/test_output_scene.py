"""Three-dimensional picture: its content, and every way it can fail."""

import errno
import os
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import h5py
import numpy as np
import output_cases
import pytest
from window_events import Hand

from capslip.errors import OutputError
from capslip.output import renderer, scene
from capslip.output.drawing import off_screen
from capslip.output.picture import STICK, WINDOW, Look, caption, draw, picture_of
from capslip.output.scene import look_of, save_picture, show, start_render
from capslip.output.tables import write_result, write_summary
from capslip.output.view import COLOURS, read_view
from capslip.output.viewer import check_page, viewer_data
from capslip.output.window import Window

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
    write_summary(output_cases.several().summary(), folder)
    return folder


@pytest.fixture(scope="module")
def opengl(tmp_path_factory):
    """Skip where VTK alone cannot render, which is no fault of this project."""
    png = tmp_path_factory.mktemp("sphere") / "sphere.png"
    subprocess.run([*python(DRAW_A_SPHERE), str(png)], capture_output=True, check=False)
    if not png.is_file():
        pytest.skip("VTK finds no OpenGL here")


@pytest.fixture(scope="module")
def drawn(opengl, result, tmp_path_factory):
    """Draw the folder of a result in a process of its own."""
    png = tmp_path_factory.mktemp("drawn") / "scene.png"
    assert start_render(result, png).wait(timeout_s=120) is None
    return png


@pytest.mark.long
def test_picture_shows_both_families(drawn):
    from matplotlib.image import imread

    red, green, blue = imread(drawn)[..., :3].transpose(2, 0, 1)
    assert (red + green + blue > 2.99).mean() > 0.3  # white paper
    assert ((red > 0.5) & (green < 0.5) & (blue < 0.2)).sum() > 500  # vermilion
    assert ((red < 0.2) & (green < 0.6) & (blue > 0.5)).sum() > 500  # blue
    assert list(drawn.parent.iterdir()) == [drawn]


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
    assert png.read_bytes() == b"an older picture"


def unwritten(error):
    """Return the program of a renderer whose picture the system refuses."""
    return python(
        "import sys; from capslip.output import scene\n"
        "def refused(pixels, path):\n"
        "    path.write_bytes(b'half'); import os\n"
        f"    raise {error}\n"
        "scene.write_png = refused\n"
        "scene.main(sys.argv[1:])"
    )


@pytest.mark.long
@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EIO])
def test_a_picture_that_the_disk_refuses_is_an_error_of_the_disk(opengl, result, tmp_path, number):
    program = unwritten(f"OSError({number}, os.strerror({number}))")
    with pytest.raises(OSError, match=r"scene\.png") as error:
        start_render(result, tmp_path / "scene.png", program).wait()
    assert (error.value.errno, error.value.strerror) == (number, os.strerror(number))
    assert not list(tmp_path.iterdir())


@pytest.mark.long
def test_an_error_without_a_number_is_that_of_the_renderer(opengl, result, tmp_path):
    reason = start_render(result, tmp_path / "scene.png", unwritten("OSError('torn')")).wait()
    assert "OSError: torn; 3-D pictures need" in reason
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO])
def test_a_screenshot_that_the_disk_refuses_says_so(result, tmp_path, monkeypatch, number):
    class Refused:
        def wait(self, timeout_s):
            raise OSError(number, os.strerror(number))

    monkeypatch.setattr(scene, "start_render", lambda *_, **__: Refused())
    with pytest.raises(OutputError) as error:
        save_picture(result, tmp_path / "seen.png", Look())
    step = "make room on its disk, or " if number == errno.ENOSPC else ""
    said = f"{tmp_path / 'seen.png'}: {os.strerror(number)}; {step}give another one"
    assert str(error.value) == said


UNFINISHED = (
    "import sys; from pathlib import Path; Path(sys.argv[2]).with_suffix('.part.png').touch()"
)


@pytest.mark.parametrize("rest", ["; sys.exit(1)", "; import time; time.sleep(60)"])
def test_renderer_that_ends_early_leaves_no_part_of_a_picture(result, tmp_path, rest):
    rendering = start_render(result, tmp_path / "scene.png", python(UNFINISHED + rest))
    while not list(tmp_path.iterdir()) and rendering.process.poll() is None:
        time.sleep(0.01)
    rendering.wait(timeout_s=0.1 if "sleep" in rest else 60.0)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "code",
    ["import sys; sys.exit(1)", UNFINISHED + "; raise OSError", "import time; time.sleep(60)"],
)
def test_a_picture_that_is_there_stays_until_another_is_whole(result, tmp_path, code):
    png = tmp_path / "scene.png"
    png.write_bytes(b"of yesterday")
    rendering = start_render(result, png, python(code))
    assert rendering.wait(timeout_s=0.5 if "sleep" in code else 60.0) is not None
    assert png.read_bytes() == b"of yesterday"
    assert list(tmp_path.iterdir()) == [png]
    drawn = UNFINISHED + "; import os; os.replace(sys.argv[2][:-4] + '.part.png', sys.argv[2])"
    assert start_render(result, png, python(drawn)).wait() is None
    assert png.read_bytes() == b""


def test_a_renderer_that_waited_leaves_the_picture_that_is_there(result, tmp_path, monkeypatch):
    monkeypatch.setattr(renderer, "cores", lambda: 2)
    monkeypatch.setattr(renderer, "RENDER", python("import sys; sys.exit('no GL context')"))
    (tmp_path / "scene.png").write_bytes(b"of yesterday")
    with renderer.ready(wanted=True) as waiting:
        assert "no GL context" in waiting.start(result, tmp_path / "scene.png").wait()
    assert (tmp_path / "scene.png").read_bytes() == b"of yesterday"


def test_renderer_that_hangs_is_ended(result, tmp_path):
    rendering = start_render(result, tmp_path / "scene.png", python("import time; time.sleep(60)"))
    assert "after 0.5 s" in rendering.wait(timeout_s=0.5)
    assert rendering.process.returncode is not None


@pytest.mark.long
def test_a_renderer_that_waited_draws_the_same_picture(drawn, result, tmp_path, monkeypatch):
    """Also where the file of the result is named in place of its folder."""
    monkeypatch.setattr(renderer, "cores", lambda: 2)
    with renderer.ready(wanted=True) as waiting:
        png = tmp_path / "other.png"
        assert waiting.start(result / "result.h5", png).wait(timeout_s=120) is None
    assert drawn.read_bytes() == png.read_bytes()


def test_a_renderer_that_dies_while_it_waits_leaves_one_line(result, tmp_path, monkeypatch):
    monkeypatch.setattr(renderer, "cores", lambda: 2)
    monkeypatch.setattr(renderer, "RENDER", python("import sys; sys.exit('no GL context')"))
    with renderer.ready(wanted=True) as waiting:
        waiting.process.wait(timeout=60)
        assert "no GL context" in waiting.start(result, tmp_path / "scene.png").wait()


def test_a_renderer_that_nobody_needs_ends(monkeypatch):
    monkeypatch.setattr(renderer, "cores", lambda: 2)
    with pytest.raises(ZeroDivisionError), renderer.ready(wanted=True) as waiting:
        raise ZeroDivisionError
    assert waiting.process.returncode is not None
    with renderer.ready(wanted=False) as none:
        assert none is None
    monkeypatch.setattr(renderer, "cores", lambda: 1)
    with renderer.ready(wanted=True) as none:
        assert none is None


def test_crash_after_the_picture_is_no_loss(result, tmp_path):
    code = "import os, sys; open(sys.argv[2], 'wb').write(b'picture'); os.abort()"
    assert start_render(result, tmp_path / "scene.png", python(code)).wait() is None


def test_window_without_a_display_is_one_clear_line(result, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with pytest.raises(OutputError, match=r"no display.*--screenshot.*--html"):
        show(result)


def test_window_needs_a_result(tmp_path):
    with pytest.raises(OutputError, match=r"or its result\.h5"):
        show(tmp_path)


def test_a_wrong_file_is_named_before_a_display_is_missed(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    (tmp_path / "scan.txt").write_text("1 2 3")
    with pytest.raises(OutputError, match=r"scan\.txt: no HDF5 file, .*expected the folder"):
        show(tmp_path / "scan.txt")


def picture(view, look):
    return picture_of(view, look, off_screen(WINDOW))


def pixels(drawing, colour):
    """Share of a picture that has about a colour, and looks lit."""
    picture = drawing.pixels().astype(np.float32) / 255.0
    red, green, blue = (int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    bright = picture.max(axis=-1) / max(red, green, blue)
    bright = np.where(bright > 0.2, bright, np.nan)
    away = np.abs(picture / bright[..., None] - (red, green, blue)).max(axis=-1)
    return float((away < 0.12).mean())


@pytest.fixture
def window(opengl, result, monkeypatch):
    """Open a window of a quarter of the pixels: without a graphics card each takes its time."""
    monkeypatch.setattr("capslip.output.window.WINDOW", (WINDOW[0] // 2, WINDOW[1] // 2))
    window = Window(read_view(result), Look(), off_screen=True)
    window.plotter.show(auto_close=False)
    yield window
    window.plotter.close()


@pytest.mark.long
def test_zones_follow_load_and_force(window):
    green, red = "#009E73", "#CC3311"
    assert pixels(window.drawing, green) < 1e-4
    window.toggle("zones")
    sticks = pixels(window.drawing, green)
    assert sticks > 1e-3
    window.change(force_share=0.7)
    assert pixels(window.drawing, green) < 0.8 * sticks
    assert pixels(window.drawing, red) > 1e-3
    slips = pixels(window.drawing, red)
    window.change(load_share=0.1)
    assert pixels(window.drawing, red) < slips
    assert "slip in part" in caption(window.view, window.look)


@pytest.mark.long
def test_parts_come_and_go(window):
    vermilion = pixels(window.drawing, "#D55E00")
    window.toggle("caps")
    assert pixels(window.drawing, "#D55E00") < 0.1 * vermilion
    window.toggle("caps")
    assert pixels(window.drawing, "#D55E00") == pytest.approx(vermilion, rel=0.01)
    window.toggle("face")
    assert "face" not in window.drawing.parts
    window.toggle("mate")
    assert "mate" in window.drawing.parts
    window.toggle("labels")
    for _ in range(5):
        window.next_colour()
    assert window.look.colour == "family"


@pytest.mark.long
def test_the_window_looks_from_where_the_picture_does_and_a_click_takes_what_is_seen(window):
    """The face is thousands of times flatter than drawn: a wide pick would take a nearer hill."""
    shown = picture(window.view, window.look).renderer.GetActiveCamera()
    seen = window.plotter.camera.GetDirectionOfProjection()
    assert seen == pytest.approx(shown.GetDirectionOfProjection())
    hand, picked = Hand(window), []
    window.select = lambda x_m, y_m: picked.append(window.plotter.picked_point)
    apexes = np.array([hand.apex(i) for i in range(len(window.view.cap))])
    clicks = (apexes[:, None] + [(0.0, 0.0), (0.0, 12.0), (9.0, -9.0)]).reshape(-1, 2).round()
    for at in clicks:
        hand.click(*at)
    renderer = window.plotter.renderer
    for at, point in zip(clicks, picked, strict=True):
        renderer.SetWorldPoint(*point, 1.0)
        renderer.WorldToDisplay()
        assert renderer.GetDisplayPoint()[:2] == pytest.approx(at, abs=1.0)


def heights(drawing, part):
    """Heights of the points of a part as they are drawn, not enlarged, by their places."""
    actor = drawing.parts[part]
    points = actor.GetMapper().GetInput().GetPoints()
    places = (points.GetPoint(i) for i in range(points.GetNumberOfPoints()))
    up_m = actor.GetPosition()[2] / actor.GetScale()[2]
    return {(round(x, 9), round(y, 9)): z + up_m for x, y, z in places}


@pytest.mark.parametrize("load", [1e-9, 1.0])
def test_two_faces_meet_in_one_point_and_then_sink_into_each_other(opengl, tmp_path, load):
    view = read_view(output_cases.written(output_cases.two_faces(), tmp_path))
    drawing = picture(view, Look(mate=True, load_share=load))
    below, above = heights(drawing, "face"), heights(drawing, "mate")
    assert set(below) == set(above)
    gap_m = np.array([above[place] - below[place] for place in below])
    beside_m2 = 0.5 * view.pixel_size_m[0] ** 2  # of the apex, at most, is the highest pixel
    sag_m = beside_m2 / (2.0 * view.columns["radius_m"].min())
    assert 0.0 <= gap_m.min() + view.approach_at(load) <= sag_m
    summed_m = view.height_m[np.isfinite(view.height_m)]
    highest_m = summed_m.max() - summed_m
    inside = gap_m < np.quantile(gap_m, 0.9)  # what lies beyond the limits is drawn at them
    gap_m, highest_m = np.sort(gap_m[inside]), np.sort(highest_m)[: inside.sum()]
    np.testing.assert_allclose(gap_m - gap_m[0], highest_m, atol=1e-12)


def test_a_second_face_that_goes_down_is_not_made_anew(opengl, tmp_path):
    view = read_view(output_cases.written(output_cases.two_faces(), tmp_path))
    before, look = Look(mate=True, load_share=1e-9), Look(mate=True, factor=7.0)
    drawing = picture(view, before)
    mate, high_m = drawing.parts["mate"], heights(drawing, "mate")
    draw(drawing, view, look, before)
    assert drawing.parts["mate"] is mate
    found_m = heights(drawing, "mate")
    anew_m = heights(picture(view, look), "mate")
    down_m = view.approach_at(1.0) - view.approach_at(1e-9)
    for place, height_m in anew_m.items():
        assert found_m[place] == pytest.approx(height_m, abs=1e-15)
        assert found_m[place] == pytest.approx(high_m[place] - down_m, abs=1e-15)


def test_caps_and_contacts_of_two_faces_lie_on_the_first(opengl, tmp_path):
    view = read_view(output_cases.written(output_cases.two_faces(), tmp_path))
    drawing = picture(view, Look(mate=True, zones=True, force_share=0.4))
    from scipy.interpolate import RegularGridInterpolator

    first = RegularGridInterpolator((view.y_m, view.x_m), view.first_m)
    for part in ("caps", "stick", "slip"):
        found = heights(drawing, part)
        x_m, y_m = np.array(list(found)).T
        inside = (x_m > 1e-3) & (x_m < 29e-3) & (y_m > 1e-3) & (y_m < 16e-3)
        below_m = first(np.stack([y_m, x_m], axis=1)[inside]) - view.first_limits_m[0]
        away_m = np.array(list(found.values()))[inside] - below_m
        assert np.nanmedian(np.abs(away_m)) < 0.01e-6  # of a face 1.3 um high, in coarse pixels
    assert "both faces" in caption(view, Look(mate=True))
    assert "both faces" not in caption(view, Look())


def test_window_shows_two_faces_or_their_sum(opengl, tmp_path):
    window = Window(
        read_view(output_cases.written(output_cases.two_faces(), tmp_path)), Look(), True
    )
    window.plotter.show(auto_close=False)
    of_sum = heights(window.drawing, "face")
    window.change(factor=10.0)
    window.toggle("mate")
    view, look = window.view, window.look
    assert look.factor_of(view) == view.exaggeration(view.first_limits_m)
    assert window.factor.GetRepresentation().GetValue() == look.factor_of(view)
    assert heights(window.drawing, "face") != of_sum
    window.toggle("mate")
    assert heights(window.drawing, "face") == of_sum
    assert window.look.factor_of(view) == view.exaggeration(view.limits_m)
    window.plotter.close()


def test_click_on_a_cap_shows_its_profile_and_beside_it_nothing(window):
    of = window.view.columns
    window.select(of["x_m"][1], of["y_m"][1])
    assert window.selected == 1
    assert window.chart is not None
    window.select(0.0, 0.0)
    assert window.selected is None
    assert window.chart is None


def test_exaggeration_is_written_and_stretches_the_face(opengl, result):
    view = read_view(result)
    drawing = picture(view, Look(factor=1234.0))
    assert "heights x 1 234;" in caption(view, Look(factor=1234.0))
    assert "heights x 6.5;" in caption(view, Look(factor=6.5))
    high_m = float(np.nanmax(view.height_m)) - view.limits_m[0]
    top_m = drawing.parts["face"].GetBounds()[5]
    assert top_m == pytest.approx(1234.0 * high_m, rel=1e-4)


def test_spheres_are_not_spoiled_by_the_face_they_coincide_with(opengl, result):
    """Seen from above, what should be a cap is one everywhere: no speckles."""
    view = read_view(result)
    drawing = picture(view, Look())
    drawing.look((0.0, 0.0, 1.0), up=(0.0, 1.0, 0.0))
    seen = drawing.pixels().astype(int)
    caps = np.abs(seen[..., 2] - seen[..., 0]) > 60
    from scipy.ndimage import binary_closing, binary_opening

    body = binary_closing(binary_opening(caps, iterations=2), iterations=8)
    assert (body & ~caps).sum() < 0.002 * body.sum()


@pytest.mark.long
def test_turntable_turns(opengl, result, tmp_path, monkeypatch):
    """As small as a stamp."""
    from PIL import Image

    small = "import sys; from capslip.output import scene; scene.FRAME_SIZE = (225, 142); "
    started = partial(start_render, command=python(small + "scene.main(sys.argv[1:])"))
    monkeypatch.setattr(scene, "start_render", started)
    save_picture(result, tmp_path / "turn.gif", look_of("load", 1.0, 0.4))
    with Image.open(tmp_path / "turn.gif") as picture:
        assert picture.size == (225, 142)
        assert picture.n_frames >= 24
        first = np.asarray(picture.convert("RGB"), dtype=int)
        picture.seek(picture.n_frames // 2)
        assert np.abs(np.asarray(picture.convert("RGB"), dtype=int) - first).mean() > 2.0


@pytest.mark.parametrize(
    ("picture", "said"), [("a.jpg", r"expected \.png or \.gif"), ("no/a.png", "no such folder")]
)
def test_picture_that_cannot_be_written_is_one_clear_line(result, tmp_path, picture, said):
    with pytest.raises(OutputError, match=said):
        save_picture(result, tmp_path / picture, Look())


def test_unknown_colour_is_one_clear_line():
    with pytest.raises(OutputError, match="expected one of family, load"):
        look_of("rainbow", 1.0, None)


def test_a_state_shows_what_sticks_and_the_mate_is_asked_for():
    assert look_of("load", 1.0, None) == Look("load")
    assert look_of("load", 0.5, None) == Look("load", load_share=0.5, zones=True)
    assert look_of("load", 1.0, 0.3, mate=True) == Look(
        "load", force_share=0.3, zones=True, mate=True
    )


def test_a_pressed_map_looks_as_much_in_contact_as_it_is(opengl, tmp_path):
    analysis = output_cases.pressed_map()
    write_result(analysis, tmp_path)
    write_summary(analysis.summary(), tmp_path)
    green = {}
    for every in (1, 7):
        view = output_cases.touching(read_view(tmp_path), every)
        drawing = picture(view, Look(caps=False, zones=True))
        drawing.look((0.0, 0.0, 1.0), up=(0.0, 1.0, 0.0))
        green[every] = pixels(drawing, STICK)
    assert green[1] > 0.1
    assert green[7] / green[1] == pytest.approx(1 / 7, rel=0.15)  # rims are half-tones


@pytest.mark.long
def test_the_picture_of_a_pressed_map_shows_what_touches(opengl, result, tmp_path):
    """Its caps do not answer; those of a result that they answer are shown alone."""
    from matplotlib.image import imread

    shown = {}
    for name, of in (("map", output_cases.written(output_cases.pressed_map(), tmp_path)),
                     ("caps", result)):  # fmt: skip
        save_picture(of, tmp_path / f"{name}.png", Look())
        red, green, blue = imread(tmp_path / f"{name}.png")[..., :3].transpose(2, 0, 1)
        shown[name] = int(((red < 0.25) & (green > 0.4) & (blue > 0.27) & (blue < 0.55)).sum())
    assert shown["map"] > 1500
    assert shown["caps"] < 150  # the arrow of the axes


def test_what_a_picture_says_does_not_reach_its_colour_bar(opengl, tmp_path):
    analysis = output_cases.pressed_map()
    write_result(analysis, tmp_path)
    write_summary(analysis.summary(), tmp_path)
    view = read_view(tmp_path)
    zones = replace(view.zones, load_N=12345.0 * view.zones.load_N)
    drawing = picture(replace(view, zones=zones), Look(zones=True, mate=True, force_share=0.5))
    drawing.remove("face", "heights")
    seen = drawing.pixels().min(axis=-1) < 128
    low = seen[int(0.85 * len(seen)) :]
    assert low.any()
    assert np.flatnonzero(low.any(axis=0)).max() < 0.53 * low.shape[1]  # the bar begins at 0.56


@pytest.mark.parametrize(
    ("end", "written"),
    [(1000.0, "1000"), (-500.0, "-500"), (992.5, "992.5"), (0.475, "0.475"), (12345.0, "12345")],
)
def test_ends_of_a_colour_bar_are_written_in_full(end, written, opengl, result):
    drawing = picture(read_view(result), Look())
    assert drawing.parts["heights"].GetLabelFormat() % end == written


def test_a_picture_of_what_is_no_result_does_not_speak_of_opengl(tmp_path):
    with h5py.File(tmp_path / "scan.h5", "w") as file:
        file["height"] = np.zeros((3, 3))
    with pytest.raises(OutputError) as error:
        save_picture(tmp_path / "scan.h5", tmp_path / "seen.png", Look())
    assert "scan.h5: an HDF5 file, but no result of an analysis" in str(error.value)
    assert "OpenGL" not in str(error.value)


def test_a_state_of_contacts_that_are_not_known_is_refused(none, tmp_path, monkeypatch):
    write_result(none, tmp_path)
    monkeypatch.setattr(scene, "start_render", lambda *_, **__: pytest.fail("drawn"))
    monkeypatch.setattr(scene.subprocess, "run", lambda *_, **__: pytest.fail("opened"))
    monkeypatch.setattr(sys, "platform", "darwin")  # where nothing tells of a display
    for look in (look_of("family", 0.5, None), look_of("family", 1.0, 0.0)):
        for draw_it, place in (
            (lambda look: save_picture(tmp_path, tmp_path / "seen.png", look), "seen.png"),
            (lambda look: show(tmp_path, look), "result.h5"),
        ):
            with pytest.raises(OutputError) as error:
                draw_it(look)
            assert str(error.value) == (
                f"{tmp_path / place}: got --load or --force; {tmp_path / 'result.h5'} knows no "
                "single contacts to show so; leave them out"
            )


@pytest.mark.parametrize(
    ("colour", "load", "got"),
    [
        ("load", 1.0, "--colour load; {}; leave it out"),
        ("loss", 1.0, "--colour loss; {}; leave it out"),
        ("load", 0.5, "--load or --force and --colour load; {}; leave them out"),
    ],
)
def test_colours_of_contacts_that_are_not_known_are_refused(
    colour, load, got, none, tmp_path, monkeypatch
):
    """All caps were coloured as if they bore nothing."""
    write_result(none, tmp_path)
    monkeypatch.setattr(scene, "start_render", lambda *_, **__: pytest.fail("drawn"))
    look, picture = look_of(colour, load, None), tmp_path / "seen.png"
    got = got.format(f"{tmp_path / 'result.h5'} knows no single contacts to show so")
    for draw_it, place in ((save_picture, picture), (check_page, tmp_path / "page.html")):
        with pytest.raises(OutputError) as error:
            draw_it(tmp_path, place, look)
        said = str(error.value)
        if place.suffix == ".html":
            said = said.replace("--load, --force or --mate", "--load or --force")
        assert said == f"{place}: got {got}"


def test_without_contacts_neither_window_nor_page_offers_their_colours(several, tmp_path):
    view = read_view(output_cases.written(several, tmp_path))
    assert tuple(viewer_data(view)["colours"]) == view.colours == COLOURS
    unknown = replace(view, zones=None)
    assert tuple(viewer_data(unknown)["colours"]) == ("family", "radius", "flag")
    window, seen = SimpleNamespace(view=unknown, look=Look("flag")), []
    window.change = lambda **given: seen.append(given)
    Window.next_colour(window)
    assert seen == [{"colour": "family", "caps": True}]


def test_a_picture_with_the_mate_says_that_no_contacts_are_known(none, several, tmp_path):
    """Nothing of a mate was drawn, or at first touch, without a word."""
    (tmp_path / "none").mkdir()
    (tmp_path / "several").mkdir()
    write_result(none, tmp_path / "none")
    known = read_view(output_cases.written(several, tmp_path / "several"))
    assert known.zones is not None
    views = (read_view(tmp_path / "none"), replace(known, zones=None))
    for view, where in zip(views, ("no mate is drawn", "the mate is where it first"), strict=True):
        assert f"no single contacts are known: {where}" in caption(view, Look(mate=True))
        assert "no single contacts" not in caption(view, Look())
    assert "no single contacts" not in caption(known, Look(mate=True))


@pytest.mark.parametrize("mate", [False, True])
def test_a_result_without_contacts_is_drawn_as_it_is(mate, opengl, none, tmp_path):
    write_result(none, tmp_path)
    save_picture(tmp_path, tmp_path / "seen.png", look_of("family", 1.0, None, mate))
    assert (tmp_path / "seen.png").is_file()


def test_what_may_not_be_read_or_written_is_said(result, tmp_path, monkeypatch):
    def locked(*_args, **_options):
        raise PermissionError(13, "Permission denied")

    with monkeypatch.context() as patched:
        patched.setattr(os, "access", lambda *_: False)
        with pytest.raises(OutputError, match=r"seen\.png: its folder cannot be written"):
            save_picture(result, tmp_path / "seen.png", Look())
    monkeypatch.setattr(h5py, "File", locked)
    with pytest.raises(OutputError, match=r"result\.h5: cannot be read \(Permission denied\)"):
        read_view(result)
