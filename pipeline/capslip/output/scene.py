"""Pictures and the window in three dimensions, each made by a process of its own.

VTK ends the whole process where it finds no display or no OpenGL library:
`python -m capslip.output.scene RESULT.h5 PICTURE LOOK`, without a picture as a window.
"""

import atexit
import gc
import json
import os
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from capslip.disk import way_out
from capslip.errors import OutputError, one_of
from capslip.output.canvas import write_png
from capslip.output.drawing import Drawing, off_screen
from capslip.output.mesh import FACE_CELLS
from capslip.output.picture import CLOSER, WINDOW, Look, picture_of
from capslip.output.renderer import (
    REMEDY,
    RENDER,
    UNWRITTEN,
    WAITS,
    Rendering,
    state_of,
    unfinished_of,
)
from capslip.output.view import COLOURS, OF_CONTACTS, check_result, read_view, result_file
from capslip.output.window import Window

OFF_SCREEN = "--screenshot FILE.png, --turntable FILE.gif or --html FILE.html need none"
PICTURE_CELLS = 70_000  # of the face: as many as turn on the page
NICE = 5  # while numbers are sought they come first
FRAMES, FRAME_ms, FRAME_SIZE = 48, 80, (900, 570)


def start_render(
    result: str | Path,
    picture: str | Path,
    command: Sequence[str] = RENDER,
    look: Look | None = None,
) -> Rendering:
    """Start to render a result; `wait()` on what is returned.

    Parameters
    ----------
    result : path
        `result.h5`, or the folder that holds it.
    picture : path
        What to make, `.png`, or `.gif` for a turntable; one that is there stays until it is whole.
    command : sequence of str
        The program, called with the two paths and the look.
    look : Look, optional
        What of the result is shown.
    """
    picture = Path(picture)
    before = state_of(picture)
    process = subprocess.Popen(
        [*command, str(result), str(picture), json.dumps(asdict(look or Look()))],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
    )
    return Rendering(process, picture, before)


def look_of(colour: str, load: float, force: float | None, mate: bool = False) -> Look:
    """Return the look that the options of the command line ask for.

    Raises
    ------
    OutputError
        If the caps cannot be coloured so.
    """
    if colour not in COLOURS:
        raise OutputError(f"--colour: got {colour}; {one_of(COLOURS, colour)}")
    state = force is not None or load < 1.0
    return Look(colour, load_share=load, force_share=force or 0.0, zones=state, mate=mate)


def save_picture(result: str | Path, picture: Path, look: Look) -> None:
    """Write a screenshot (`.png`) or a turntable (`.gif`), off screen.

    Raises
    ------
    OutputError
        If there is no result, it knows no contacts that the look asks for, or the picture cannot
        be made.
    """
    check_picture(result, picture, look)
    try:
        reason = start_render(result_file(result), picture, look=look).wait(timeout_s=300.0)
    except OSError as error:
        step = way_out(error, "give another one")
        raise OutputError(f"{picture}: {error.strerror}; {step}") from error
    if reason is not None:
        raise OutputError(f"{picture}: {reason}")


def check_picture(result: str | Path, picture: Path, look: Look) -> None:
    """Refuse a picture that cannot show a result so, before anything is written.

    Raises
    ------
    OutputError
        As `save_picture`.
    """
    known = check_result(result)
    if picture.suffix.lower() not in (".png", ".gif"):
        raise OutputError(f"{picture}: got {picture.suffix or 'no suffix'}; expected .png or .gif")
    if not picture.parent.is_dir():
        raise OutputError(f"{picture}: no such folder; make it, or give another one")
    if not os.access(picture.parent, os.W_OK):
        raise OutputError(f"{picture}: its folder cannot be written; give another one")
    _check_state(known, look, result, picture)


def _check_state(known: bool, look: Look, result: str | Path, place: Path) -> None:
    """Refuse what contacts show of which nothing is known; a flat mate is drawn without them."""
    if known:
        return
    of_contacts = ["--load or --force"] if look.zones else []
    of_contacts += [f"--colour {look.colour}"] if look.colour in OF_CONTACTS else []
    if of_contacts:
        raise OutputError(
            f"{place}: got {' and '.join(of_contacts)}; {result_file(result)} knows no single "
            f"contacts to show so; leave {'them' if look.zones else 'it'} out"
        )


def show(result: str | Path, look: Look | None = None) -> None:
    """Open a window on a result; returns when it is closed.

    Parameters
    ----------
    result : path
        `result.h5`, or the folder that holds it.
    look : Look, optional
        What is shown first.

    Raises
    ------
    OutputError
        If there is no result, it knows no contacts that the look asks for, or there is no display
        or no OpenGL.
    """
    known = check_result(result)
    result = result_file(result)
    _check_state(known, look or Look(), result, result)
    on_x11 = sys.platform not in ("darwin", "win32")
    if on_x11 and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        raise OutputError(f"{result}: no display to open a window on; {OFF_SCREEN}")
    words = [str(result), "", json.dumps(asdict(look or Look()))]
    done = subprocess.run([*RENDER, *words], check=False)
    if done.returncode:
        raise OutputError(f"{result}: the window ended with code {done.returncode}; {REMEDY}")


def _ready() -> Drawing:
    """Return an empty drawing that has drawn one of each part, which is slow the first time."""
    import h5py  # noqa: F401
    from PIL import Image

    drawing = off_screen(WINDOW)
    mesh, colours = (np.eye(3), np.array([[0, 1, 2]])), ("#000000",)
    for name, closer in {"face": 0.0, **CLOSER}.items():
        drawing.surface(name, *mesh, values=np.zeros(3), colours=colours, closer=closer)
    drawing.bar("bar", "face", "m", (0.5, 0.0), 0.5)
    drawing.legend("legend", [("0", "#000000")])
    drawing.words("words", "0")
    drawing.look((0.0, 0.0, 1.0), up=(0.0, 1.0, 0.0))
    drawing.pixels()
    drawing.remove(*tuple(drawing.parts))
    Image.preinit()
    return drawing


def _screenshot(drawing: Drawing, picture: Path) -> None:
    write_png(drawing.pixels(), picture)


def _turntable(drawing: Drawing, picture: Path) -> None:
    """Write one turn around the face."""
    from PIL import Image

    drawing.window.SetSize(*FRAME_SIZE)
    frames = []
    for _ in range(FRAMES):
        frames.append(Image.fromarray(drawing.pixels()).quantize(128))
        drawing.renderer.GetActiveCamera().Azimuth(360.0 / FRAMES)
        drawing.renderer.ResetCameraClippingRange()
    frames[0].save(
        picture, "GIF", save_all=True, append_images=frames[1:], duration=FRAME_ms, loop=0
    )


def main(arguments: list[str]) -> None:
    """Render `RESULT.h5` to `PICTURE`, or open a window; `--waits` reads which one later."""
    atexit.register(gc.freeze)  # who waits for the picture waits for the end
    drawing = None
    if arguments == [WAITS]:
        os.nice(NICE)
        drawing = _ready()
        line = sys.stdin.readline()
        if not line:  # there was no result
            return
        arguments = json.loads(line)
    result, picture, look = arguments
    view = read_view(result, PICTURE_CELLS if picture else FACE_CELLS)
    shown = Look(**json.loads(look))
    if view.zones is not None and view.zones.of_map:
        shown = replace(shown, zones=True)  # caps do not answer then
    if not picture:
        Window(view, shown).show()
        return
    path = Path(picture)
    picture_of(view, shown, drawing := drawing or off_screen(WINDOW))
    unfinished = unfinished_of(path)
    write = _turntable if path.suffix.lower() == ".gif" else _screenshot
    try:
        write(drawing, unfinished)
        os.replace(unfinished, path)
    except OSError as error:
        if error.errno is None:
            raise
        raise SystemExit(f"{UNWRITTEN}{error.errno}") from error


if __name__ == "__main__":
    main(sys.argv[1:])
