"""The folder that an analysis leaves: numbers first, then what no number depends on."""

import shutil
import time
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec

from capslip.disk import is_full
from capslip.errors import CapslipError, check_call, check_kind, check_text, path_of, truth_of
from capslip.output import figures as all_figures
from capslip.output import mesh, report, scene, staging, tables
from capslip.output.aside import Aside
from capslip.output.export import Export, export_named
from capslip.output.renderer import Ready, Rendering
from capslip.output.whatif import whatif_data
from capslip.problems import Problem
from capslip.result import Analysis, JointOfScans, JointResult
from capslip.settings import settings_from
from capslip.waiting import Waiting

NUMBERS = {"result.h5", "caps.csv", "settings.toml", staging.SUMMARY}

Missing = Callable[[str, Exception | None], None]


def write(
    analysis: Analysis,
    folder: str | Path,
    *,
    command: str | None = None,
    timings_s: dict[str, float] | None = None,
    figures: bool | None = None,
    render: bool | None = None,
    page: bool = True,
    export: str | None = None,
    renderer: Ready | None = None,
    progress: Callable[[str], None] = lambda _: None,
    missing: Missing = lambda _, __: None,
) -> dict[str, Any]:
    """Write the folder of a result, as the command line does.

    Everything is written into a temporary folder inside it, `summary.json` last, whose files then
    take their places. A figure, picture, mesh, report or export that fails takes no number along:
    it becomes a problem `output_missing`, in the summary that is returned, too. So do those that
    were made where the disk is full: they make room for the numbers.

    Parameters
    ----------
    analysis : Analysis
        Any analysis, a failed one as well.
    folder : path
        New, empty, or an earlier result, which is replaced.
    command : str, optional
        What was called, for the record.
    timings_s : dict, optional
        Seconds of what was done before, such as reading.
    figures, render : bool, optional
        Whether to draw the figures and the three-dimensional picture; by default `settings.run`.
    page : bool, optional
        Whether to write `report.html`, whose tables for other preloads take as long as the rest.
    export : {"jenkins", "law"}, optional
        Write the joint for another program, too: `jenkins.csv`, parallel Jenkins elements of its
        slip curve; or `law.*`, the law of its face per area over pressure.
    renderer : Ready, optional
        One of `output.renderer.ready` that waits; otherwise one is started.
    progress : callable, optional
        Told what is done next, one line at a time.
    missing : callable, optional
        Told, in one line, what could not be made, and the exception if there was one. A machine
        without display or OpenGL has no three-dimensional picture; that alone is no problem.

    Returns
    -------
    dict
        The content of `summary.json`, with the digests of all files.

    Raises
    ------
    OutputError
        If the folder is a file, cannot be written, holds files that no analysis wrote, or holds
        the scan itself, or if its disk has no room for the numbers.
    SettingsError
        If the export is none of those known, or an argument is of the wrong type.

    Examples
    --------
    >>> import capslip, tempfile
    >>> from capslip.studies.faces.synthetic import CapFamily, Scene, synthetic_surface
    >>> scene = Scene((100, 150), (4e-4, 4e-4), families=(CapFamily("G", 6, 24.0),))
    >>> analysis = capslip.analyze(synthetic_surface(scene)[0])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     summary = write(analysis, Path(folder) / "face", figures=False, render=False)
    >>> summary["hills"]["caps"], summary["status"]
    (6, 'ok')
    """
    check_kind("analysis", analysis, Analysis, "an Analysis; make one with capslip.analyze")
    check_text("command", command)
    check_text("export", export)
    check_kind("timings_s", timings_s, (dict, type(None)), "a dictionary, or None")
    check_kind("renderer", renderer, (Ready, type(None)), "one of renderer.ready, or None")
    check_call("progress", progress)
    check_call("missing", missing)
    page = truth_of("page", page)
    extra = None if export is None else export_named(export)
    folder, scan = path_of("folder", folder), analysis.surface.origin.path
    staging.check_folder(folder, keep=(scan,))
    wanted = {"figures": figures, "render": render}
    given = {name: wish for name, wish in wanted.items() if wish is not None}
    wishes = settings_from({"run": given}).run
    given = {name: getattr(wishes, name) for name in given}
    run = msgspec.structs.replace(analysis.settings.run, **given)
    analysis = replace(analysis, settings=msgspec.structs.replace(analysis.settings, run=run))
    with staging.new_folder(folder) as work:
        parts = _Parts(analysis, work, timings_s or {}, progress, missing)
        parts.write_numbers()
        if page or run.figures or run.render:
            (work / "figures").mkdir()
        no_scene = parts.draw(extra, renderer, page)
        if page:
            parts.write_page(command, no_scene)
        total_s = sum((analysis.timings_s | parts.timings_s).values())
        return parts.write_summary(command, {**parts.timings_s, "total": total_s})


def write_joint(
    result: JointResult,
    folder: Path,
    command: str | None,
    timings_s: dict[str, float] | None = None,
    export: str | None = None,
    progress: Callable[[str], None] = lambda _: None,
    missing: Missing = lambda _, __: None,
) -> dict[str, Any]:
    """Write `settings.toml` and `summary.json` of given families or of several scans.

    Of several scans there are figures, a report and what was to be exported, too. Returns the
    summary; parameters and errors are those of `write`.
    """
    extra = None if export is None else export_named(export)
    with staging.new_folder(folder) as work:
        tables.write_settings(result.settings, work)
        parts = _Parts(result, work, timings_s or {}, progress, missing)
        if isinstance(result, JointOfScans):
            parts.draw_scans(result, extra)
            parts.write_page(command, None)
        return parts.write_summary(command, parts.timings_s)


class _Parts:
    """The parts of one result; one that fails becomes a problem of the analysis."""

    def __init__(
        self,
        analysis: Any,  # an Analysis, or a JointResult
        work: Path,
        timings_s: dict[str, float],
        progress: Callable[[str], None],
        missing: Missing,
    ) -> None:
        self.analysis, self.work = analysis, work
        self.progress, self.missing = progress, missing
        self.timings_s = dict(timings_s)
        self.panel: dict[str, Any] | None = None
        self.clock_s = time.perf_counter()

    def lap(self, stage: str) -> None:
        """Note the seconds since the last stage ended."""
        before_s, self.clock_s = self.clock_s, time.perf_counter()
        self.timings_s[stage] = self.clock_s - before_s

    def make(self, names: tuple[str, ...], function: Callable[..., Any], *arguments: Any) -> Any:
        """Call what makes some files; where it fails, leave none of them and return None."""
        try:
            return function(*arguments)
        except Exception as error:
            self.leave_out(names, error)
            return None

    def leave_out(self, names: tuple[str, ...], error: Exception) -> None:
        """Leave none of some files that could not be made, and say why."""
        for name in names:
            (self.work / name).unlink(missing_ok=True)
        reason = str(error)
        if is_full(error):
            reason = f"{error.strerror}; make room on the disk"
        elif not isinstance(error, CapslipError):
            reason = f"{type(error).__name__}: {error}"
        files = " and ".join(Path(name).name for name in names)
        text = " ".join(f"{files} could not be made: {reason}".split())
        self.say(Problem("output_missing", "warning", text), error)

    def say(self, problem: Problem, error: Exception | None = None) -> None:
        """Add a problem to those of the analysis, and tell it where it is more than a note."""
        if problem.severity != "info":
            self.missing(problem.message, error)
        self.analysis = replace(self.analysis, problems=(*self.analysis.problems, problem))

    def export(self, export: Export | None) -> None:
        """Write the joint for another program, where that was asked for."""
        if export is not None:
            found = self.make(export.files, export.write, self.analysis, self.work)
            for problem in found or ():
                self.say(problem)
            self.lap("export")  # a law solves its map under ten pressures

    def write_numbers(self) -> None:
        """Write tables and settings."""
        tables.write_result(self.analysis, self.work)
        self.lap("tables")

    def write_summary(self, command: str | None, timings_s: dict[str, float]) -> dict[str, Any]:
        """Write the last of the numbers, and return it; on a full disk what is none gives way."""
        try:
            summary = self._write_summary(command, timings_s)
            staging.check_room(self.work)
            return summary
        except OSError as error:
            if not is_full(error):
                raise
            self.make_room(error)
            return self._write_summary(command, timings_s)

    def _write_summary(self, command: str | None, timings_s: dict[str, float]) -> dict[str, Any]:
        summary = self.analysis.summary(command, timings_s)
        summary = staging.with_digests(summary, self.work)
        tables.write_summary(summary, self.work)
        return summary

    def make_room(self, error: Exception) -> None:
        """Remove what no number depends on, and say so."""
        gone = []
        for path in sorted(self.work.iterdir()):
            if path.is_dir():
                gone += [path.name] if any(path.iterdir()) else []
                shutil.rmtree(path)
            elif path.name not in NUMBERS:
                gone.append(path.name)
                path.unlink()
        if gone:
            text = (
                f"{' and '.join(gone)} gave way to the numbers: the disk is full; make room on it"
            )
            self.say(Problem("output_missing", "warning", text), error)

    def prepare_page(self) -> None:
        """Find what takes the page some time."""
        report.template()
        with suppress(Exception):  # told when the page is written
            self.panel = whatif_data(self.analysis)

    def write_page(self, command: str | None, no_scene: str | None) -> None:
        """Write the report, which says why there is no picture."""
        self.progress("writing the report")
        summary = self.analysis.summary(command, self.timings_s)
        given = self.analysis, summary, self.work, no_scene, self.panel
        self.make(("report.html",), report.write_report, *given)
        self.lap("report")

    def draw(self, export: Export | None, renderer: Ready | None, page: bool) -> str | None:
        """Make export, meshes and figures beside the picture; return why there is no picture."""
        run, rendering = self.analysis.settings.run, None
        pictures, parameters = self.work / "figures", self.analysis.iso25178
        name = "figures/scene.png"
        features = Aside(parameters.features) if run.figures and parameters.few_points else None
        if run.render:
            self.progress("rendering")
            start = scene.start_render if renderer is None else renderer.start
            rendering = self.make((name,), start, self.work / "result.h5", self.work / name)
        try:
            self.export(export)
            if run.meshes:
                files = ("surface.vtu", "caps.vtu")
                self.make(files, mesh.write_meshes, self.analysis, self.work)
                self.lap("meshes")
            if run.figures:
                self.draw_figures(all_figures.FIGURES, pictures)
            if page:
                self.prepare_page()  # while others are at work
            if features is not None:
                parameters.take(features.wait())
            if not run.render:
                return "switched off (--no-render)"
            reason = self.rendered(rendering, name)
        except BaseException:
            if rendering is not None:
                rendering.stop()
            raise
        finally:
            if features is not None:
                features.stop()
        self.lap("render")
        return reason

    def rendered(self, rendering: Rendering | None, name: str) -> str | None:
        """Wait for the picture, and return why there is none; a disk that refuses it is told."""
        reason: str | None = "the renderer did not start"
        if rendering is not None:
            try:
                reason = rendering.wait()
            except OSError as error:
                self.leave_out((name,), error)
                return self.analysis.problems[-1].message
        if reason is not None:
            self.missing(f"no render: {reason}", None)
        return reason

    def draw_figures(self, names: Collection[str], pictures: Path) -> None:
        """Draw the figures of those names, half of them in a copy of this process."""
        self.progress("drawing")
        waiting = Waiting("drawing", "figures")
        first, *others = names

        def draw(some: Collection[str]) -> dict[str, Exception]:
            failed = {}
            for name in some:
                try:
                    all_figures.write_figure(name, self.analysis, pictures)
                except Exception as error:
                    failed[name] = error
            return failed

        failed = draw((first,))  # loads what both need
        half = len(others) // 2
        aside = Aside(lambda: draw(others[half:]))
        try:
            for done, name in enumerate(others[:half], 1):
                failed |= draw((name,))
                waiting.tell(1 + 2 * done, len(names))  # the copy is about as far
            failed |= aside.wait()
        finally:
            aside.stop()
        for name, error in failed.items():
            self.leave_out((f"figures/{name}.png",), error)
        self.lap("figures")

    def draw_scans(self, joint: JointOfScans, export: Export | None) -> None:
        """Make export and figures of a joint of several scans."""
        self.export(export)
        pictures = self.work / "figures"
        pictures.mkdir()
        if joint.settings.run.figures:
            self.draw_figures(all_figures.OF_JOINT, pictures)
