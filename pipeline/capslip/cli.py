"""The command line: the only place that prints or exits."""

import json
import os
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from capslip import __version__
from capslip.errors import CapslipError, ContactError, ScanError, SettingsError

if TYPE_CHECKING:
    from capslip.problems import Problem
    from capslip.result import Analysis
    from capslip.settings import Settings
    from capslip.surface.heightmap import HeightMap

MODELS = (
    "auto",
    "flat",
    "families",
    "caps",
    "mean_field",
    "interacting",
    "boundary_elements",
)
UNITS = ("m", "mm", "um", "µm", "nm", "inch")


class _Failure(click.ClickException):
    """One line on stderr and the exit code that the error stands for."""

    def __init__(self, error: CapslipError, exit_code: int | None = None) -> None:
        super().__init__(str(error))
        self.exit_code = error.exit_code if exit_code is None else exit_code  # type: ignore[misc]

    def show(self, file: Any = None) -> None:
        click.echo(f"error: {self.message}", err=True)


class _Command(click.Command):
    """A command that turns the project's errors into one line; `-v` shows the traceback."""

    def invoke(self, ctx: click.Context) -> Any:
        try:
            return super().invoke(ctx)
        except CapslipError as error:
            if ctx.params.get("verbose"):
                traceback.print_exc()
            raise _Failure(error) from error
        except KeyboardInterrupt as error:
            stopped = CapslipError("interrupted; of what was running no result was written")
            raise _Failure(stopped, 130) from error  # 128 and the signal's number, as in shells
        except (click.ClickException, click.exceptions.Exit, click.Abort):
            raise
        except MemoryError as error:
            raise _Failure(CapslipError("not enough memory for this analysis")) from error
        except Exception as error:
            if ctx.params.get("verbose"):
                traceback.print_exc()
            text = (
                f"internal error: {type(error).__name__}: {error}; run again with -v and report it"
            )
            raise _Failure(CapslipError(" ".join(text.split()))) from error


class _Group(click.Group):
    command_class = _Command


def _result_options(command: Any) -> Any:
    """Add the options that every command with a result has."""
    for option in (
        click.option("-v", "--verbose", is_flag=True, help="Show tracebacks and details."),
        click.option("-q", "--quiet", is_flag=True, help="Errors only on stderr."),
        click.option(
            "--json", "as_json", is_flag=True, help="Only the numbers, as JSON, on stdout."
        ),
        click.option("-o", "--out", type=click.Path(path_type=Path), help="Output folder."),
    ):
        command = option(command)
    return command


def _common(command: Any) -> Any:
    """Add the options of a command that analyses."""
    for option in (
        click.option(
            "--set",
            "overrides",
            multiple=True,
            metavar="TABLE.KEY=VALUE",
            help="Change one setting; repeatable.",
        ),
        click.option("-c", "--config", type=click.Path(path_type=Path), help="Settings (TOML)."),
    ):
        command = option(command)
    return _result_options(command)


def _analysis_options(command: Any) -> Any:
    """Add the options that stand for single settings of an analysis."""
    for option in (
        click.option("--render/--no-render", default=None, help="The PyVista picture."),
        click.option("--figures/--no-figures", default=None, help="Pictures of every stage."),
        click.option(
            "--pixel-size",
            type=(float, float),
            metavar="DY DX",
            help="Size of a pixel, where the file does not say; needs --lateral-unit.",
        ),
        click.option("--lateral-unit", type=click.Choice(UNITS), help="Unit of the pixel size."),
        click.option("--unit", type=click.Choice(UNITS), help="Unit of the heights."),
        click.option("--dataset", help="Dataset of an HDF5 file."),
        click.option("--model", type=click.Choice(MODELS), help="Contact model."),
        click.option("--preload", type=float, metavar="N", help="Normal load of one joint, in N."),
    ):
        command = option(command)
    return command


@click.group(cls=_Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="capslip")
def main() -> None:
    """From a scan of a joint face to its damping."""
    # The systems of equations are small: threads of the linear algebra only wait for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


@main.command()
@click.argument("surface", type=click.Path(path_type=Path))
@_analysis_options
@click.option("--mate", type=click.Path(path_type=Path), help="Scan of the other face.")
@click.option(
    "--export",
    type=click.Choice(["jenkins"]),
    help="Write the slip curve for another solver: jenkins.csv, parallel Jenkins elements.",
)
@_common
def analyze(
    surface: Path,
    out: Path | None,
    as_json: bool,
    quiet: bool,
    mate: Path | None,
    export: str | None,
    **options: Any,
) -> None:
    """Analyse one scan: caps, families, contact, slip, damping, pictures and report."""
    from capslip.output import store

    settings = _settings(**options)
    if export is not None and settings.contact.model == "flat":
        raise SettingsError(
            f"--export {export}: contact.model is flat, which slips only as a whole; expected a "
            "model with caps; take one slider with the force at total slip instead"
        )
    folder = out if out is not None else Path("results") / surface.stem
    if surface.is_file():  # otherwise the reader says what is wrong with it
        store.check_folder(folder, keep=(surface, mate))
    say = _Progress(quiet)

    analysis, read_s = _load_and_analyze(surface, mate, settings, say)
    if not as_json and not quiet:
        from capslip.output.terminal import result_lines

        click.echo(result_lines(analysis))
    parts = _Parts(say, options["verbose"])
    with store.new_folder(folder) as work:
        summary = _write(analysis, work, say, {"read": read_s}, parts, export)
    if as_json:
        click.echo(json.dumps(summary, indent=1, ensure_ascii=False, allow_nan=False))
    elif not quiet:
        click.echo(f"\nresults    {folder}\nreport     {folder / 'report.html'}")
    errors = [p.message for p in analysis.problems if p.severity == "error"]
    if errors:
        raise ScanError(f"{surface}: {errors[0]}; what was found before is in {folder}")
    if parts.missing:
        text = f"{parts.missing[0].message}; all numbers are in {folder}"
        if parts.internal:
            raise CapslipError(f"internal error: {text}; run again with -v and report it")
        raise ScanError(text)


class _Parts:
    """Makes parts of a result that no number depends on; one that fails is a problem."""

    def __init__(self, say: "_Progress", verbose: bool) -> None:
        self.say, self.verbose = say, verbose
        self.missing: list[Problem] = []
        self.internal = False  # whether a failure was none that is raised on purpose

    def make(self, paths: tuple[Path, ...], function: Callable[..., Any], *arguments: Any) -> Any:
        """Call what makes some files; where it fails, leave none of them and return None."""
        from capslip.problems import Problem

        try:
            return function(*arguments)
        except Exception as error:
            if self.verbose:
                traceback.print_exc()
            for path in paths:
                path.unlink(missing_ok=True)
            name = " and ".join(path.name for path in paths)
            reason = str(error)
            if not isinstance(error, CapslipError):
                self.internal, reason = True, f"{type(error).__name__}: {error}"
            text = " ".join(f"{name} could not be made: {reason}".split())
            self.say.warn(text)
            self.missing.append(Problem("output_missing", "warning", text))
            return None


def _export_jenkins(analysis: "Analysis", work: Path) -> None:
    from capslip.structure.jenkins import jenkins, write_jenkins

    if analysis.slip is None:
        raise ContactError("it needs a slip curve, which this analysis does not have")
    write_jenkins(jenkins(analysis.slip), work / "jenkins.csv")


def _load_and_analyze(
    surface: Path, mate: Path | None, settings: "Settings", say: "_Progress"
) -> tuple["Analysis", float]:
    from capslip.analysis import analyze as run
    from capslip.surface.readers import load_surface

    reading = settings.reading

    def load(path: Path) -> "HeightMap":
        say(f"reading {path.name}")
        return load_surface(
            path,
            unit=reading.unit,
            lateral_unit=reading.lateral_unit,
            pixel_size=reading.pixel_size,
            dataset=reading.dataset,
            lenient=reading.lenient,
        )

    started = time.perf_counter()
    height_map, other = load(surface), load(mate) if mate is not None else None
    read_s = time.perf_counter() - started
    say("analysing")
    return run(height_map, settings, other), read_s


def _write(
    analysis: "Analysis",
    work: Path,
    say: "_Progress",
    timings: dict[str, float],
    parts: _Parts,
    export: str | None,
) -> dict[str, Any]:
    """Write everything into the working folder, numbers first, the summary last; return it."""
    from capslip.output import mesh, report, scene, store

    run = analysis.settings.run

    def timed(stage: str, since: float) -> float:
        now = time.perf_counter()
        timings[stage] = now - since
        return now

    clock = time.perf_counter()
    store.write_result(analysis, work)
    if export is not None:
        parts.make((work / f"{export}.csv",), _export_jenkins, analysis, work)
    meshes = (work / "surface.vtu", work / "caps.vtu")
    parts.make(meshes, mesh.write_meshes, analysis, work)
    clock = timed("tables", clock)
    (work / "figures").mkdir()
    message: str | None = "switched off (--no-render)"
    if run.render:
        say("rendering")
        png = work / "figures" / "scene.png"
        rendering = parts.make((png,), scene.start_render, work / "result.h5", png)
    if run.figures:
        say("drawing")
        from capslip.output.figures import FIGURES, write_figure

        for name in FIGURES:
            png = work / "figures" / f"{name}.png"
            parts.make((png,), write_figure, name, analysis, png.parent)
        clock = timed("figures", clock)
    if run.render:
        message = "the renderer did not start"
        if rendering is not None:
            message = rendering.wait()
        if message is not None:
            say.warn(f"no render: {message}")
        clock = timed("render", clock)
    say("writing the report")
    command = " ".join(["capslip", *sys.argv[1:]])

    def whole() -> "Analysis":
        return replace(analysis, problems=(*analysis.problems, *parts.missing))

    numbers = whole().summary(command, timings)
    page = (work / "report.html",)
    parts.make(page, report.write_report, whole(), numbers, work, message)
    timed("report", clock)
    summary = whole().summary(command, {**timings, "total": say.elapsed_s()})
    store.write_summary(summary, work)
    return summary


@main.command()
@click.argument("scans", nargs=-1, required=True)
@_analysis_options
@_common
def batch(
    scans: tuple[str, ...], out: Path | None, as_json: bool, quiet: bool, **options: Any
) -> None:
    """Analyse every scan of a folder or a glob; done work is kept."""
    from capslip.batch import run_batch

    settings = _settings(**options)
    say = _Progress(quiet)
    rows = run_batch(scans, out or Path("results") / "batch", settings, say)
    failed = [row for row in rows if row["status"] == "failed"]
    incomplete = [row for row in rows if row["error"] and row not in failed]
    if as_json:
        click.echo(json.dumps(rows, indent=1, ensure_ascii=False))
    elif not quiet:
        for row in rows:
            click.echo(f"{row['status']:7} {row['scan']}  {row['error'] or ''}".rstrip())
    if failed:
        say.warn(f"{len(failed)} of {len(rows)} scans failed; see batch.csv")
        sys.exit(3)
    if incomplete:
        say.warn(f"{len(incomplete)} of {len(rows)} results lack a part; see batch.csv")
        sys.exit(1)


@main.command()
@click.argument("result", type=click.Path(path_type=Path))
@click.option("-v", "--verbose", is_flag=True, help="Show tracebacks and details.")
def inspect(result: Path, verbose: bool) -> None:
    """Look at the fitted caps of a result in a PyVista window."""
    from capslip.output.scene import show

    show(result)


@main.command()
@_result_options
def reproduce(out: Path | None, as_json: bool, quiet: bool, verbose: bool) -> None:
    """Reproduce the paper's tables and figures, and show what is wrong in print."""
    from capslip.studies.paper.reproduce import reproduce as run

    folder = out if out is not None else Path("results") / "reproduce"
    numbers = run(folder)
    if as_json:
        click.echo(json.dumps(numbers, indent=1, ensure_ascii=False, allow_nan=False))
    elif not quiet:
        worst = max(abs(row["relative_error"]) for row in numbers["table1"])
        click.echo(f"table 1    {len(numbers['table1'])} loads within {100 * worst:.2f} %")
        click.echo(f"errata     {len(numbers['errata'])}")
        click.echo(f"page       {folder / 'reproduce.html'}")


@main.command()
@click.argument("result", type=click.Path(path_type=Path))
@click.option(
    "--assembly",
    type=click.Path(path_type=Path),
    required=True,
    metavar="CSV",
    help="Measured damping of the assembled structure.",
)
@click.option(
    "--monolithic",
    type=click.Path(path_type=Path),
    metavar="CSV",
    help="The same of the structure without joints, to be subtracted.",
)
@click.option("--identify", is_flag=True, help="Fit friction coefficient and preload.")
@_result_options
def compare(
    result: Path,
    assembly: Path,
    monolithic: Path | None,
    identify: bool,
    out: Path | None,
    as_json: bool,
    quiet: bool,
    verbose: bool,
) -> None:
    """Compare a result with measured damping (CSV: amplitude_um,loss_factor and the like)."""
    from capslip.studies import compare_result as study

    found = study.compare_result(result, assembly, monolithic, identify)
    if out is not None:
        study.write_comparison(found, out)
    if as_json:
        click.echo(json.dumps(study.to_dict(found), indent=1, ensure_ascii=False, allow_nan=False))
    elif not quiet:
        click.echo("\n".join(study.lines(found)))
        if out is not None:
            click.echo(f"picture    {out / 'compare.png'}")


@main.command()
@_result_options
def bench(out: Path | None, as_json: bool, quiet: bool, verbose: bool) -> None:
    """Time commands, stages and solvers beside their peers (minutes)."""
    from capslip.studies.bench.study import bench_markdown, run_bench

    folder = out if out is not None else Path("results") / "bench"
    result = run_bench(folder)
    if as_json:
        click.echo(json.dumps(result, indent=1, ensure_ascii=False, default=float))
    elif not quiet:
        click.echo(bench_markdown(result))


@main.command()
@click.option("--scans", type=click.Path(path_type=Path), help="Folder of real scans to add.")
@_result_options
def chart(scans: Path | None, out: Path | None, as_json: bool, quiet: bool, verbose: bool) -> None:
    """Chart speed against accuracy of every method (many minutes)."""
    from capslip.studies.chart.study import chart as run

    folder = out if out is not None else Path("results") / "chart"
    result = run(folder, scans, _Progress(quiet))
    if as_json:
        click.echo(json.dumps(result, indent=1, ensure_ascii=False, default=float))
    elif not quiet:
        click.echo(f"chart      {folder / 'speed-accuracy.md'}")


@main.command()
@_result_options
def limits(out: Path | None, as_json: bool, quiet: bool, verbose: bool) -> None:
    """Drive each axis until the method breaks, and see what the program says (many minutes)."""
    from capslip.studies.limits.study import limits as run

    folder = out if out is not None else Path("results") / "limits"
    result = run(folder, _Progress(quiet))
    if as_json:
        click.echo(json.dumps(result, indent=1, ensure_ascii=False, default=float))
    elif not quiet:
        click.echo(f"limits     {folder / 'limits.md'}")


@main.command("init-config")
@click.argument("path", type=click.Path(path_type=Path), default="capslip.toml")
def init_config(path: Path) -> None:
    """Write a settings file with every default, to be edited."""
    import tomli_w

    from capslip.errors import OutputError
    from capslip.settings import Settings

    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(tomli_w.dumps(Settings().to_dict()))
    except FileExistsError:
        raise OutputError(
            f"{path}: exists already; nothing was written; give another name"
        ) from None
    except OSError as error:
        raise OutputError(f"{path}: {error.strerror}; give another name") from error
    click.echo(path)


@main.command()
def formats() -> None:
    """List the file formats that can be read."""
    from capslip.surface.readers import formats as known

    for row in known():
        click.echo(f"{row.name:12} {' '.join(row.extensions):24} {row.note}")


def _settings(
    config: Path | None, overrides: tuple[str, ...], verbose: bool, **options: Any
) -> "Settings":
    """Read the file, then `--set`, then the options of their own."""
    from capslip.settings import load_settings

    place = {
        "preload": "contact.preload_N",
        "model": "contact.model",
        "dataset": "reading.dataset",
        "unit": "reading.unit",
        "lateral_unit": "reading.lateral_unit",
        "pixel_size": "reading.pixel_size",
        "figures": "run.figures",
        "render": "run.render",
    }
    given = {place[name]: value for name, value in options.items() if value is not None}
    for name, value in given.items():
        if isinstance(value, float) and value != value:
            raise SettingsError(f"{name}: got nan; expected a finite number")
    texts = tuple(f"{name}={_toml(value)}" for name, value in given.items())
    return load_settings(config, (*overrides, *texts))


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, tuple):
        return f"[{', '.join(_toml(inner) for inner in value)}]"
    return repr(float(value)) if isinstance(value, float) else json.dumps(value)


class _Progress:
    """Messages on stderr, each with the seconds since the start; silent with `-q`."""

    def __init__(self, quiet: bool) -> None:
        self.quiet = quiet
        self.started = time.perf_counter()

    def __call__(self, message: str) -> None:
        if not self.quiet:
            click.echo(f"[{self.elapsed_s():5.1f} s] {message}", err=True)

    def elapsed_s(self) -> float:
        """Return the seconds since the command began."""
        return time.perf_counter() - self.started

    def warn(self, message: str) -> None:
        click.echo(f"warning: {message}", err=True)
