"""The page that shows a result in three dimensions, in a real browser."""

import base64
import errno
import os
import re
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import output_cases
import pytest

from browser import ask, ask_each, needs_chromium, picture, together
from capslip.errors import OutputError
from capslip.output import viewer
from capslip.output.picture import Look, state_line
from capslip.output.scene import look_of
from capslip.output.tables import write_result, write_summary
from capslip.output.view import read_view
from capslip.output.viewer import viewer_block, viewer_data, write_viewer
from capslip.output.zones import zone_at


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("result")
    analysis = output_cases.several()
    write_result(analysis, folder)
    write_summary(analysis.summary(), folder)
    return folder


@pytest.fixture(scope="module")
def page(folder):
    write_viewer(folder, folder / "view.html")
    return folder / "view.html"


STATES = [(1.0, 0.0), (1.0, 0.4), (1.0, 0.93), (0.4, 0.6), (0.02, 0.1), (1.0, 1.0)]
COUNTS = f"return {[list(s) for s in STATES]}.map((s) => window.capslipViewer.counts(...s))"
FORCE = (
    "const s = window.capslipViewer.sliders.force; s.value = 0.6;"
    's.dispatchEvent(new Event("input"))'
)
SAY = 'document.querySelector(".viewer").innerText'
FIRST = (
    "const v = window.capslipViewer, s = v.sliders;"
    "const { colour, load, force, zones, mate } = v.state;"
    "return [[colour, load, force, zones, mate],"
    "  [s.colour.value, +s.load.value, +s.force.value, s.zones.checked, s.mate.checked],"
    '  s.face.checked && s.caps.checked, document.querySelector(".viewer").innerText]'
)
TOUCHES = "const v = window.capslipViewer; return [v.state.zones, v.sliders.zones.checked]"
CLICK = """const v = window.capslipViewer, canvas = document.querySelector("canvas.face");
        const caps = JSON.parse(document.getElementById("viewer-data").textContent).caps;
        const f4 = (t) => new Float32Array(Uint8Array.from(atob(t), (c) => c.charCodeAt(0)).buffer);
        const data = JSON.parse(document.getElementById("viewer-data").textContent);
        const [x, y] = v.seen(f4(caps.x)[1], f4(caps.y)[1], f4(caps.peak)[1] - data.low);
        const box = canvas.getBoundingClientRect();
        const at = { clientX: x + box.left, clientY: y + box.top, pointerId: 1, bubbles: true };
        canvas.setPointerCapture = () => {};
        canvas.dispatchEvent(new PointerEvent("pointerdown", at));
        canvas.dispatchEvent(new PointerEvent("pointerup", at));
        const hidden = document.querySelector("canvas.profile").hidden;
        return [document.querySelector(".row").innerText, hidden];"""
SIZE = """const face = document.querySelector("canvas.face");
        return [document.documentElement.scrollWidth, face.clientHeight / face.clientWidth];"""
FRAMES = """const v = window.capslipViewer, from = performance.now();
        for (let i = 0; i < 20; i++) { v.state.zones = true; v.state.force = i / 20; v.update(); }
        return (performance.now() - from) / 20;"""


@pytest.fixture(scope="module")
def asked(page, tmp_path_factory):
    """Ask the page all at once."""
    looks = {"counts": COUNTS, "say": f"return {SAY}", "first": FIRST, "touches": TOUCHES}
    scripts = {"looks": together(looks | {"1400": SIZE}), "420": (SIZE, 420), "click": CLICK}
    scripts |= {"force": f"{FORCE}; return {SAY}", "frames": FRAMES}
    found = ask_each(page, scripts, tmp_path_factory.mktemp("asked"))
    return found | found["looks"]


def unpacked(text, kind):
    return np.frombuffer(base64.b64decode(text), dtype=f"<{kind}")


def test_page_holds_the_heights_to_a_sixteen_thousandth(folder):
    view = read_view(folder)
    data = viewer_data(view)
    level = unpacked(data["z"], "u2").astype(float)
    seen = level < 65535
    height_m = data["low"] + (data["high"] - data["low"]) * level / 65534.0
    np.testing.assert_array_equal(seen, np.isfinite(view.height_m.ravel()))
    clipped_m = np.clip(view.height_m.ravel(), data["low"], data["high"])
    np.testing.assert_allclose(
        height_m[seen], clipped_m[seen], atol=(data["high"] - data["low"]) / 65534.0
    )


def test_page_is_one_file_that_loads_nothing(page):
    text = page.read_text("utf-8")
    assert not re.search(r'(src|href)="(?!data:|#)', text)
    assert "http" not in text
    assert len(text) < 3e6


def test_page_into_a_folder_that_is_not_there_is_one_clear_line(folder, tmp_path):
    with pytest.raises(OutputError, match="No such file"):
        write_viewer(folder, tmp_path / "none" / "view.html")


@pytest.mark.parametrize(
    ("number", "step"),
    [
        (errno.ENOSPC, "make room on its disk, or give another name"),
        (errno.EIO, "give another name"),
    ],
)
def test_half_a_page_takes_no_place(folder, tmp_path, monkeypatch, number, step):
    page, whole = tmp_path / "view.html", Path.write_text
    page.write_text("of yesterday", "utf-8")

    def half(path, text, encoding):
        whole(path, text[: len(text) // 2], encoding)
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(Path, "write_text", half)
    with pytest.raises(OutputError) as error:
        write_viewer(folder, page)
    assert str(error.value) == f"{page}: {os.strerror(number)}; {step}"
    assert page.read_text("utf-8") == "of yesterday"
    assert list(tmp_path.iterdir()) == [page]


def test_a_link_to_a_page_stays_one(folder, tmp_path):
    (tmp_path / "site").mkdir()
    link, page = tmp_path / "view.html", tmp_path / "site" / "face.html"
    link.symlink_to(page)
    write_viewer(folder, link)
    assert link.is_symlink()
    assert page.stat().st_size > 10_000


@pytest.mark.parametrize("name", ["face.x3p", "face", "face.html.h5"])
def test_a_file_that_is_no_page_is_not_replaced(folder, tmp_path, name):
    (tmp_path / name).write_text("measured")
    with pytest.raises(OutputError, match=r"got (\.x3p|no suffix|\.h5); expected \.html or \.htm$"):
        write_viewer(folder, tmp_path / name)
    assert (tmp_path / name).read_text() == "measured"


@pytest.mark.parametrize("name", ["face.htm", "FACE.HTML"])
def test_a_page_has_either_ending(folder, tmp_path, name):
    write_viewer(folder, tmp_path / name)
    assert "viewer-data" in (tmp_path / name).read_text()


@pytest.mark.long
@needs_chromium
def test_page_counts_what_touches_sticks_and_slips_as_python_does(folder, asked):
    zones = read_view(folder).zones
    for state, counts in zip(STATES, asked["counts"], strict=True):
        words = zone_at(zones, *state).word
        assert counts == {word: int((words == word).sum()) for word in counts}


@pytest.mark.long
@needs_chromium
def test_page_shows_face_caps_and_zones_and_says_so(page, asked, tmp_path):
    """Neither a blank scene nor lost text."""
    plain = picture(page, tmp_path)
    red, green, blue = plain.transpose(2, 0, 1)
    assert ((red > 150) & (green < 130) & (blue < 60)).sum() > 500  # vermilion
    assert ((red < 60) & (green < 130) & (blue > 100)).sum() > 500  # blue
    grey = (np.ptp(plain, axis=-1) < 12) & (red > 60) & (red < 230)
    assert grey.sum() > 20_000
    red, green, blue = picture(page, tmp_path, FORCE).transpose(2, 0, 1)
    assert ((red < 60) & (green > 100) & (blue > 70) & (blue < 140)).sum() > 100  # sticks
    assert ((red > 120) & (green < 70) & (blue < 40)).sum() > 100  # slips
    for words in ("60 % of gross slip", "slip in part", "Heights ×", "G-caps (2)", "flat mate"):
        assert words in asked["force"]


@pytest.mark.long
@needs_chromium
def test_page_begins_as_its_picture_looks(folder, asked, tmp_path):
    view = read_view(folder)
    plain, beads, shown, said = asked["first"]
    assert plain == beads == ["family", 1.0, 0.0, False, False]
    assert shown
    assert "of gross slip:" not in said
    look = look_of("loss", 0.3, 0.9, mate=True)
    write_viewer(folder, tmp_path / "view.html", look)
    first, beads, shown, said = ask(tmp_path / "view.html", FIRST, tmp_path)
    assert first == beads == ["loss", 0.3, 0.9, True, True]
    assert shown
    assert f"45 N, force 90 % of gross slip: {state_line(view, look).splitlines()[1]}" in said
    assert "share of the loss [%]" in said
    assert "G-caps" not in said
    red, _, blue = picture(tmp_path / "view.html", tmp_path).transpose(2, 0, 1)
    assert (blue > red + 40).sum() > 100_000  # the mate, seen through
    write_viewer(folder, tmp_path / "force.html", look_of("load", 1.0, 0.4))
    first, *_ = ask(tmp_path / "force.html", FIRST, tmp_path)
    assert first == ["load", 1.0, 0.4, True, False]


@pytest.mark.long
@needs_chromium
def test_page_that_begins_with_two_faces_enlarges_the_heights_of_the_first(tmp_path, monkeypatch):
    view = read_view(output_cases.written(output_cases.two_faces(), tmp_path))
    view = replace(view, second_m=5.0 * view.second_m)
    monkeypatch.setattr(viewer, "read_view", lambda *_: view)
    factors = {}
    for mate in (False, True):
        look = look_of("family", 1.0, None, mate)
        write_viewer(tmp_path, tmp_path / "view.html", look)
        asked = "return window.capslipViewer.state.factor"
        factors[mate] = ask(tmp_path / "view.html", asked, tmp_path)
        assert factors[mate] == look.factor_of(view)
    assert factors[True] < factors[False]


def test_page_refuses_the_state_of_contacts_that_are_not_known(folder, tmp_path):
    folder = shutil.copytree(folder, tmp_path / "unknown")
    with h5py.File(folder / "result.h5", "r+") as file:
        del file["zones"]
    page = tmp_path / "view.html"
    for given in ((0.5, None), (1.0, 0.0), (1.0, None, True)):
        with pytest.raises(OutputError, match=r"--mate; .*knows no single contacts") as error:
            write_viewer(folder, page, look_of("family", *given))
        assert str(error.value).startswith(f"{page}: got --load")
        assert not page.exists()
    write_viewer(folder, page, look_of("radius", 1.0, None))
    assert page.exists()


@pytest.mark.long
@needs_chromium
def test_page_of_a_pressed_map_begins_with_what_touches(asked, tmp_path):
    analysis = output_cases.pressed_map()
    write_result(analysis, tmp_path)
    write_summary(analysis.summary(), tmp_path)
    write_viewer(tmp_path, tmp_path / "view.html")
    assert ask(tmp_path / "view.html", TOUCHES, tmp_path) == [True, True]
    assert asked["touches"] == [False, False]


@pytest.mark.long
@needs_chromium
def test_page_says_how_much_of_a_pressed_map_touches_as_the_window_does(tmp_path, monkeypatch):
    view = read_view(output_cases.written(output_cases.pressed_map(), tmp_path))
    write_viewer(tmp_path, tmp_path / "view.html")
    set_to = (
        "const v = window.capslipViewer; Object.assign(v.state, { load: %s, force: %s });"
        'v.update(); return document.querySelector(".viewer .state").innerText'
    )
    areas, states = {}, ((1.0, 0.0), (0.5, 0.0), (1.0, 0.5), (0.5, 1.0))
    asked = ask(tmp_path / "view.html", together({s: set_to % s for s in states}), tmp_path)
    for state in states:
        said = state_line(view, Look(load_share=state[0], force_share=state[1]))
        said = " ".join(said.split("\n")[1:])
        assert said in asked[str(state)]
        areas[state] = re.search(r"about (\S+) mm² touch, (\d+) % of it sticks", said).groups()
    contact_mm2 = 1e6 * view.summary["contact"]["contact_area_m2"]
    assert float(areas[1.0, 0.0][0]) == pytest.approx(contact_mm2, rel=5e-3)
    assert areas[1.0, 0.0][1] == "100"
    assert areas[0.5, 1.0] == (areas[0.5, 0.0][0], "0")
    sticks = float(areas[0.5, 0.0][0]) / contact_mm2
    assert float(areas[1.0, 0.5][1]) == pytest.approx(100.0 * sticks, abs=0.7)
    assert 0.4 < sticks < 0.8
    monkeypatch.setattr(viewer, "PIXELS", len(view.zones.pixel) // 3)  # not all are drawn
    write_viewer(tmp_path, tmp_path / "view.html")
    said = ask(tmp_path / "view.html", set_to % (1.0, 0.0), tmp_path)
    (area,) = re.findall(r"about (\S+) mm² touch", said)
    assert float(area) == pytest.approx(contact_mm2, rel=0.03)


@pytest.mark.long
@needs_chromium
def test_no_name_ends_the_data_or_the_page(folder, tmp_path):
    view = replace(read_view(folder), summary={"name": "a <!--<script> b </script>"})
    page = tmp_path / "view.html"
    shown = f"{viewer_block(view)}<p id=after></p>"
    page.write_text(f"<html><head></head><body>{shown}</body></html>", "utf-8")
    asked = (
        'const data = JSON.parse(document.getElementById("viewer-data").textContent);'
        'return [data.name.replaceAll("<", "["),'
        'document.getElementById("after") !== null, "capslipViewer" in window]'
    )
    assert ask(page, asked, tmp_path) == [view.name.replace("<", "["), True, True]


@pytest.mark.long
@needs_chromium
def test_a_pressed_map_looks_as_much_in_contact_as_it_is(tmp_path, monkeypatch):
    analysis = output_cases.pressed_map()
    write_result(analysis, tmp_path)
    write_summary(analysis.summary(), tmp_path)
    view = read_view(tmp_path)
    from_above = (
        'const face = document.querySelector("canvas.face");'
        "for (let i = 0; i < 15; i++)"
        '  face.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowUp" }));'
    )
    green = {}
    for every in (1, 7):
        seen = output_cases.touching(view, every)
        monkeypatch.setattr(viewer, "read_view", lambda *_, seen=seen: seen)
        write_viewer(tmp_path, tmp_path / "view.html")
        r, g, b = picture(tmp_path / "view.html", tmp_path, from_above).transpose(2, 0, 1)
        green[every] = int(((r < 60) & (g > 100) & (b > 70) & (b < 140)).sum())
    assert green[1] > 10_000
    assert green[7] / green[1] == pytest.approx(1 / 7, rel=0.15)


@pytest.mark.long
@needs_chromium
def test_page_shows_two_faces_or_their_sum(asked, tmp_path):
    view = read_view(output_cases.written(output_cases.two_faces(), tmp_path))
    write_viewer(tmp_path, tmp_path / "view.html")
    both = (
        "const s = window.capslipViewer.sliders.mate; s.checked = true;"
        's.dispatchEvent(new Event("input"));'
    )
    at = [(0.004, 0.003, 0.2e-6), (0.0141, 0.0102, 0.9e-6), (0.0252, 0.0051, 0.9e-6)]
    placed = f"{[list(place) for place in at]}.map((p) => window.capslipViewer.placed(...p))"
    then = f"const was = [{placed}, {SAY}]; {both} return [...was, {placed}, {SAY}]"
    alone, said_alone, found, said = ask(tmp_path / "view.html", then, tmp_path)
    assert alone == pytest.approx([z for *_, z in at])
    low_m, high_m = view.first_limits_m
    for (x_m, y_m, z_m), height_m in zip(at, found, strict=True):
        on_first_m = (
            view.limits_m[0] + z_m - float(view.second_at(np.array([x_m]), np.array([y_m]))[0])
        )
        clipped_m = min(max(on_first_m, low_m), high_m) - low_m
        assert height_m == pytest.approx(clipped_m, abs=1e-10)
    assert "Both faces" in said
    assert "Both faces" not in said_alone
    assert "both faces" not in asked["say"]
    apart = picture(tmp_path / "view.html", tmp_path, both)
    red, blue = apart[..., 0].astype(int), apart[..., 2].astype(int)
    assert ((blue > red + 12) & (red > 60)).sum() > 20_000  # the second, seen through


@pytest.mark.long
@needs_chromium
def test_click_on_a_cap_shows_its_row_and_profile(asked):
    said = asked["click"]
    assert said[0].startswith("cap 2, family G")
    assert "of the loss" in said[0]
    assert said[1] is False


@pytest.mark.long
@needs_chromium
@pytest.mark.parametrize("width", [420, 1400])
def test_page_fits_its_width(asked, width):
    wide, shape = asked[str(width)]
    assert wide <= width
    assert 0.4 < shape < 1.3  # neither a slit nor a shaft with the face somewhere in it


@pytest.mark.long
@needs_chromium
def test_slider_answers_within_a_frame(asked):
    assert asked["frames"] < 16.0
