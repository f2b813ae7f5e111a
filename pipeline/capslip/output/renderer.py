"""The process that draws the face in three dimensions, seen from the one that starts it."""

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

RENDER = (sys.executable, "-P", "-m", "capslip.output.scene")  # -P: no module beside the scans
WAITS = "--waits"
UNWRITTEN = "not written, error "  # begins the line that names a number of the system
REMEDY = (
    "3-D pictures need the package vtk and an OpenGL library "
    "(Debian, Ubuntu: libgl1, libegl1 or libosmesa6; other systems: Mesa)"
)


def unfinished_of(picture: Path) -> Path:
    """Return where a picture is written, to take its place when it is complete."""
    return picture.with_suffix(f".part{picture.suffix}")


def state_of(picture: Path) -> tuple[int, int] | None:
    """Return what another picture under the same name has otherwise; None where there is none."""
    try:
        found = picture.stat()
    except OSError:
        return None
    return found.st_ino, found.st_mtime_ns


@dataclass(frozen=True)
class Rendering:
    """A picture under way in a process of its own."""

    process: "subprocess.Popen[str]"
    picture: Path
    before: tuple[int, int] | None = None  # state of one that was there, and stays where this fails

    def wait(self, timeout_s: float = 60.0) -> str | None:
        """Wait for the picture, at most `timeout_s` from now.

        Returns
        -------
        str or None
            None when the picture is there; otherwise one line that says why not and what to
            install.

        Raises
        ------
        OSError
            If the picture was drawn and could not be written, as on a full disk.
        """
        try:
            _, stderr = self.process.communicate(timeout=timeout_s)
        except subprocess.TimeoutExpired:
            self.stop()
            return f"the renderer was not ready after {timeout_s:g} s"
        # Renamed when complete: a crash while VTK shuts down does no harm
        if state_of(self.picture) not in (None, self.before):
            return None
        unfinished_of(self.picture).unlink(missing_ok=True)
        lines = [line.strip() for line in stderr.splitlines() if line.strip()]
        for line in lines:
            if line.startswith(UNWRITTEN):
                number = int(line.removeprefix(UNWRITTEN))
                raise OSError(number, os.strerror(number), str(self.picture))
        reason = f": {lines[-1][:200]}" if lines else ""
        return f"the renderer ended with code {self.process.returncode}{reason}; {REMEDY}"

    def stop(self) -> None:
        """End the renderer, with or without a picture."""
        self.process.kill()
        self.process.communicate()
        unfinished_of(self.picture).unlink(missing_ok=True)


@dataclass(frozen=True)
class Ready:
    """A renderer that has loaded what it needs, or still does, and waits for what to draw."""

    process: "subprocess.Popen[str]"

    def start(self, result: Path, picture: Path) -> Rendering:
        """Start to render a result, as `scene.start_render` does."""
        assert self.process.stdin is not None
        before = state_of(picture)
        with contextlib.suppress(BrokenPipeError):  # it ended, and `wait` says why
            self.process.stdin.write(json.dumps([str(result), str(picture), "{}"]) + "\n")
            self.process.stdin.flush()
        return Rendering(self.process, picture, before)


@contextmanager
def ready(wanted: bool) -> Iterator[Ready | None]:
    """Give a renderer that loads meanwhile, on a second core where there is one; else None."""
    if not wanted or cores() < 2:
        yield None
        return
    process = subprocess.Popen(
        [*RENDER, WAITS],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        errors="replace",
    )
    with process:
        try:
            yield Ready(process)
        finally:
            process.kill()


def cores() -> int:
    """Return on how many cores this process may run, as far as the system says."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
