"""The command line: its commands."""

import atexit
import gc
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from capslip import __version__, registry
from capslip.console import (
    Group,
    Progress,
    ending,
    open_streams,
    print_result,
    say_result,
    to_width,
)
from capslip.errors import ScanError, SettingsError
from capslip.options import (
    PATH,
    SHARE,
    above_zero,
    analysis_options,
    joint_options,
    not_of_reading,
    one_alone,
    reading_options,
    result_options,
    settings_of,
    settings_options,
    shard_of,
    verbose_option,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from capslip.result import JointResult
    from capslip.settings import Settings
    from capslip.surface.heightmap import HeightMap


@click.group(cls=Group, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, prog_name="capslip")
def main() -> None:
    """From a scan of a joint face to its damping."""
    open_streams()
    # The systems of equations are small: threads of the linear algebra only wait for each other.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # A command ends soon: to look for unused circles of objects after every 700 takes 4 % of it
    gc.set_threshold(20_000, 20, 20)
    atexit.register(gc.freeze)  # nor is one worth finding when all memory is given back: 0.25 s


@main.command()
@click.argument("surfaces", type=PATH, nargs=-1, required=True, metavar="SURFACE...")
@analysis_options
@click.option("--mate", type=PATH, help="Scan of the other face.")
@click.option(
    "--export",
    type=click.Choice(registry.names("output.exports")),
    multiple=True,
    callback=one_alone,
    help="For another program, one at a time: jenkins.csv, sliders; law.*, its face per area.",
)
def analyze(
    surfaces: tuple[Path, ...],
    out: Path | None,
    as_json: bool,
    quiet: bool,
    mate: Path | None,
    export: str | None,
    **options: Any,
) -> None:
    """Analyse one scan: caps, contact, slip, damping and a report.

    Several scans are patches of one joint of --area: one answer for it, with their scatter.
    """
    from capslip.analysis import analyze as run
    from capslip.output.export import check_export
    from capslip.output.renderer import ready
    from capslip.output.staging import check_folder
    from capslip.output.terminal import result_lines

    settings = settings_of(**options)
    surface, *more = surfaces
    if more:
        if mate is not None:
            raise SettingsError(f"--mate: got {len(surfaces)} scans; expected one with it")
        _analyze_scans(surfaces, settings, export, out, as_json, quiet, options["verbose"])
        return
    if export is not None:
        check_export(export, settings)
    folder = out if out is not None else Path("results") / surface.stem
    if os.path.isfile(surface):  # otherwise the reader says what is wrong with it
        check_folder(folder, keep=(surface, mate))
    say = Progress(quiet, options["verbose"])
    with ready(settings.run.render) as renderer:
        face, other = _load(surface, settings, say, mate)
        if out is None:
            _tell_replaced(folder, [face], say)
        timings_s = {"read": say.elapsed_s()}
        analysis = run(face, settings, other, progress=say)
        if not as_json and not quiet:
            say_result(to_width(result_lines(analysis)))
        from capslip.output.folder import write  # loads while the numbers are read

        summary = write(
            analysis,
            folder,
            command=_command_line(),
            timings_s=timings_s,
            export=export,
            renderer=renderer,
            progress=say,
            missing=say.missing,
        )
    print_result(summary, ending(analysis, summary, folder), as_json, quiet)
    _raise_errors(analysis, folder, f"{surface}: ")
    say.raise_failures(folder)


def _analyze_scans(
    surfaces: tuple[Path, ...],
    settings: "Settings",
    export: str | None,
    out: Path | None,
    as_json: bool,
    quiet: bool,
    verbose: bool,
) -> None:
    """Analyse several scans of one joint."""
    from capslip.analysis import analyze_scans, check_scans
    from capslip.output.folder import write_joint
    from capslip.output.staging import check_folder
    from capslip.output.terminal import result_lines

    check_scans(surfaces, settings)
    folder = out or Path("results") / f"{surfaces[0].stem}-and-{len(surfaces) - 1}-more"
    check_folder(folder, keep=surfaces)
    say = Progress(quiet, verbose)
    faces: dict[str | None, HeightMap] = {}
    for path in surfaces:
        face, _ = _load(path, settings, say)
        if (same := faces.setdefault(face.origin.sha256, face)) is not face:
            raise SettingsError(
                f"{path}: holds what {same.origin.path} holds; expected another place of the joint"
            )
    timings_s = {"read": say.elapsed_s()}
    if out is None:
        _tell_replaced(folder, faces.values(), say)
    say(f"analysing {len(faces)} scans")
    result = analyze_scans(list(faces.values()), settings)
    if not as_json and not quiet:
        say_result(to_width(result_lines(result)))
    summary = write_joint(
        result, folder, _command_line(), timings_s, export, progress=say, missing=say.missing
    )
    print_result(summary, ending(result, summary, folder), as_json, quiet)
    _raise_errors(result, folder)
    say.raise_failures(folder)


def _tell_replaced(folder: Path, faces: "Iterable[HeightMap]", say: Progress) -> None:
    """Say whose result gives way in a folder that nobody chose; of the same scans none does."""
    from capslip.output.staging import scans_replaced

    if of := scans_replaced(folder, (face.origin for face in faces)):
        say.warn(f"{folder} holds a result of {' and '.join(of)}, which is replaced; see --out")


def _raise_errors(result: "JointResult", folder: Path | None, of: str = "") -> None:
    """End as failed where a stage had no answer."""
    for problem in result.problems:
        if problem.severity == "error":
            rest = f"; what was found before is in {folder}" if folder else ""
            raise ScanError(f"{of}{problem.text}; next: {problem.advice}{rest}")


def _load(
    path: Path, settings: "Settings", say: Progress, mate: Path | None = None
) -> tuple["HeightMap", "HeightMap | None"]:
    from capslip.surface.readers.faces import load_faces

    say(f"reading {path.name}" + (f" and {mate.name}" if mate is not None else ""))
    return load_faces(path, mate, settings.reading)


@main.command()
@click.option("--m", type=int, help="Number of G-caps, the higher ones.")
@click.option("--n", type=int, help="Number of P-caps.")
@click.option("--radius-G", "radius_g", metavar="20m", help="Of a G-cap; a number is in m.")
@click.option("--radius-P", "radius_p", metavar="20m", help="Of a P-cap; a number is in m.")
@click.option("--h", metavar="0.24um", help="G-peaks above P-peaks; a number is in m.")
@click.option("--approach", metavar="0.25um", help="In place of the preload; a number is in m.")
@joint_options
@result_options
def families(out: Path | None, as_json: bool, quiet: bool, **options: Any) -> None:
    """Answer for given families, without a scan.

    A folder is written only with -o.
    """
    from capslip.analysis import analyze_families
    from capslip.output.folder import write_joint
    from capslip.output.terminal import result_lines

    result = analyze_families(settings_of(**options))
    command = _command_line()
    summary = write_joint(result, out, command) if out else result.summary(command)
    print_result(summary, result_lines(result), as_json, quiet, only_copy=out is None)
    _raise_errors(result, out)


@main.command()
@click.argument("scans", nargs=-1)
@analysis_options
@click.option("--list", "list_file", type=PATH, help="Scans, one a line or CSV with their preload.")
@click.option("--recursive", is_flag=True, help="Take the folders in a folder, too.")
@click.option("--workers", type=int, help="Processes; 0: one a core.")
@click.option("--timeout", "time_s", type=float, metavar="S", help="Longest time of a scan.")
@click.option("--memory", "memory_GB", type=float, metavar="GB", help="Most memory of a scan.")
@click.option("--scheduler", metavar="ADDRESS", help="Dask scheduler whose workers do it.")
@click.option("--shard", metavar="I/N", help="Do the I-th of N parts, and no table.")
@click.option("--collect", is_flag=True, help="Only make the table of all shards.")
@click.option("--dry-run", is_flag=True, help="Only say what would be done.")
@click.option("--retry-failed", is_flag=True, help="Analyse again what failed.")
@click.option("--max-failures", type=click.IntRange(1), metavar="N", help="Stop after so many.")
def batch(
    scans: tuple[str, ...],
    out: Path | None,
    as_json: bool,
    quiet: bool,
    list_file: Path | None,
    recursive: bool,
    time_s: float | None,
    memory_GB: float | None,
    scheduler: str | None,
    shard: str | None,
    collect: bool,
    dry_run: bool,
    retry_failed: bool,
    max_failures: int | None,
    **options: Any,
) -> None:
    """Analyse files, folders, globs or a list; done work is kept."""
    from capslip.batch import TO_DO, Options, run_batch
    from capslip.workers import Limits

    settings = settings_of(**options)
    above_zero(time_s, "--timeout")
    above_zero(memory_GB, "--memory")
    # 0 would be no limit
    most_bytes = None if memory_GB is None else max(1, int(min(memory_GB, 1e9) * 1e9))
    if shard is not None and collect:
        raise SettingsError("--collect: makes the table of all shards; leave out --shard")
    if dry_run and collect:
        raise SettingsError("--dry-run: writes nothing; leave out --collect, which writes a table")
    say = Progress(quiet)
    rows = run_batch(
        scans,
        out or Path("results") / "batch",
        settings,
        say,
        _command_line(),
        Options(
            list_file=list_file,
            recursive=recursive,
            shard=None if shard is None else shard_of(shard),
            look="collect" if collect else "dry_run" if dry_run else None,
            retry_failed=retry_failed,
            max_failures=max_failures,
            limits=Limits(time_s, most_bytes),
            scheduler=scheduler,
            warn=say.warn,
        ),
    )
    failed = [row for row in rows if row["status"] == "failed"]
    incomplete = [row for row in rows if row["error"] and row["status"] != "failed"]
    lines = [f"{row['status']:7} {row['scan']}  {row['error'] or ''}".rstrip() for row in rows]
    page = (out or Path("results") / "batch") / "index.html"
    if page.is_file() and not dry_run:
        lines += ["", f"page       {page}"]
    print_result(rows, "\n".join(lines), as_json, quiet)
    to_do = sum(row["status"] == TO_DO for row in rows)
    dry, kept = "; nothing was done" * dry_run, "; --retry-failed does them again" * dry_run
    if to_do:
        say.warn(f"{to_do} of {len(rows)} scans are still to be done{dry}")
    if failed:
        say.warn(f"{len(failed)} of {len(rows)} scans failed; see batch.csv{kept}")
    if dry_run:
        return
    if failed or to_do:
        sys.exit(3)
    if incomplete:
        say.warn(f"{len(incomplete)} of {len(rows)} results lack a part; see batch.csv")
        sys.exit(1)


@main.command()
@click.argument("result", type=PATH)
@click.option("--screenshot", type=PATH, metavar="PNG", help="A picture, without a window.")
@click.option("--turntable", type=PATH, metavar="GIF", help="One turn around it, without a window.")
@click.option("--html", type=PATH, metavar="HTML", help="A page that turns, in one file, offline.")
@click.option(
    "--colour", metavar="NAME", default="family", help="family, load, radius, flag or loss."
)
@click.option("--load", type=SHARE, default=1.0, help="Normal load over the preload, 0 to 1.")
@click.option("--force", type=SHARE, help="Tangential force over gross slip: shows what slips.")
@click.option("--mate", is_flag=True, help="With the mate: a flat one, or the second face.")
@verbose_option
def inspect(result: Path, html: Path | None, verbose: bool, **options: Any) -> None:
    """Look at the caps of a result in a window, or write pictures."""
    from capslip.output.scene import check_picture, look_of, save_picture, show
    from capslip.output.viewer import check_page, write_viewer

    pictures = [path for path in (options.pop("screenshot"), options.pop("turntable")) if path]
    look = look_of(**options)
    for picture in pictures:
        check_picture(result, picture, look)
    if html is not None:
        check_page(result, html, look)
    for picture in pictures:
        save_picture(result, picture, look)
    if html is not None:
        write_viewer(result, html, look)
    for path in (*pictures, *([html] if html else [])):
        say_result(str(path))
    if not pictures and html is None:
        show(result, look)


@main.command()
@click.argument("scans", type=PATH, nargs=-1, required=True, metavar="SCAN...")
@click.option("-o", "--out", type=PATH, metavar="FILE", help="By default FIRST-mean.h5, here.")
@settings_options
@reading_options
@click.option("-q", "--quiet", is_flag=True, help="Nothing but errors, on stderr.")
@verbose_option
def average(scans: tuple[Path, ...], out: Path | None, quiet: bool, **options: Any) -> None:
    """Average repeated scans of one place, and tell their noise.

    The mean is written with the noise that is left in it, which `analyze` then knows.
    """
    from capslip.output.convert import refuse_file
    from capslip.output.terminal import average_lines
    from capslip.surface.average import average as run
    from capslip.surface.readers.hdf5 import write_hdf5

    settings = settings_of(**options)
    path = out or Path(f"{scans[0].stem}-mean.h5")
    refuse_file(path, "h5")
    say = Progress(quiet, options["verbose"])
    if (idle := not_of_reading(settings)) is not None:
        say.warn(idle)
    maps = [_load(scan, settings, say)[0] for scan in scans]
    found, names = run(maps), [scan.name for scan in scans]
    write_hdf5(found.surface, path, mean_of=found.surface.origin.mean_of)
    if not quiet:
        say_result(to_width(average_lines(found, names, path)))


@main.command()
@click.argument("result", type=PATH)
@click.option("--to", required=True, type=click.Choice(registry.names("output.formats")))
@click.option("-o", "--out", type=PATH, metavar="FILE", help="By default RESULT.FORMAT, here.")
@verbose_option
def export(result: Path, to: str, out: Path | None, verbose: bool) -> None:
    """Write the face of a result, in metres, for another program."""
    from capslip.output.convert import export_result

    path, left_out = export_result(result, to, out)
    if left_out is not None:
        Progress(quiet=False).warn(left_out)
    say_result(str(path))


@main.command()
@click.argument("result", type=PATH)
@click.option("--assembly", type=PATH, required=True, metavar="CSV", help="Measured damping.")
@click.option("--monolithic", type=PATH, metavar="CSV", help="The same without joints, subtracted.")
@click.option("--identify", is_flag=True, help="Fit friction coefficient and preload.")
@result_options
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
    """Compare a result with measured damping.

    It is a CSV of two columns, such as amplitude_um,loss_factor.
    """
    from capslip.compare import check_place, compare_result, lines, to_dict, write_comparison

    if out is not None:
        check_place(out)  # before the work
    say = Progress(quiet, verbose)
    say(f"comparing {result} with {assembly}")
    found = compare_result(result, assembly, monolithic, identify)
    text = lines(found)
    if out is not None:
        write_comparison(found, out)
        text = [*text, f"picture    {out / 'compare.png'}"]
    print_result(to_dict(found), "\n".join(text), as_json, quiet, only_copy=out is None)


@main.command()
@result_options
def reproduce(out: Path | None, as_json: bool, quiet: bool, verbose: bool) -> None:
    """Reproduce the paper's tables and figures, and its errata."""
    from capslip.studies.paper.reproduce import reproduce as run

    folder = out or Path("results") / "reproduce"
    numbers = run(folder)
    worst = max(abs(row["relative_error"]) for row in numbers["table1"])
    text = (
        f"table 1    {len(numbers['table1'])} loads within {100 * worst:.2f} %\n"
        f"errata     {len(numbers['errata'])}\npage       {folder / 'reproduce.html'}"
    )
    print_result(numbers, text, as_json, quiet)


@main.command()
@result_options
def bench(out: Path | None, as_json: bool, quiet: bool, verbose: bool) -> None:
    """Time commands, stages and solvers (minutes)."""
    from capslip.studies.bench.study import bench_markdown, run_bench

    result = run_bench(out or Path("results") / "bench")
    print_result(result, bench_markdown(result), as_json, quiet)


@main.command()
@click.option("--scans", type=PATH, help="Folder of real scans to add.")
@result_options
def chart(scans: Path | None, out: Path | None, as_json: bool, quiet: bool, verbose: bool) -> None:
    """Chart speed against accuracy of every method (many minutes)."""
    from capslip.studies.chart.study import chart as run

    folder = out or Path("results") / "chart"
    result = run(folder, scans, Progress(quiet))
    print_result(result, f"chart      {folder / 'speed-accuracy.md'}", as_json, quiet)


@main.command()
@click.option("--workers", type=click.IntRange(0), default=0, help="Processes; 0: one a core.")
@result_options
def limits(workers: int, out: Path | None, as_json: bool, quiet: bool, verbose: bool) -> None:
    """Drive each axis until the method breaks (many minutes)."""
    from capslip.studies.limits.study import limits as run
    from capslip.studies.limits.text import limits_lines

    folder = out or Path("results") / "limits"
    result = run(folder, Progress(quiet), workers)
    text = f"{limits_lines(result)}\nlimits           {folder / 'limits.md'}"
    print_result(result, text, as_json, quiet)


@main.command("init-config")
@click.argument("path", type=PATH, default="capslip.toml")
def init_config(path: Path) -> None:
    """Write a settings file with every default, to be edited."""
    from importlib.resources import files

    from capslip.disk import way_out, write_whole
    from capslip.errors import OutputError

    text = files("capslip").joinpath("default.toml").read_bytes()
    try:
        if os.path.lexists(path):
            raise OutputError(f"{path}: exists already; nothing was written; give another name")
        write_whole(path, lambda unfinished: unfinished.write_bytes(text))
    except OSError as error:
        step = way_out(error, "give another name")
        raise OutputError(f"{path}: {error.strerror}; {step}") from error
    say_result(str(path))


@main.command()
def formats() -> None:
    """List the file formats that can be read."""
    from capslip.surface.readers import FORMATS

    for row in FORMATS:
        said = f"{row.name:12} {' '.join(row.extensions):24} {row.note}"
        say_result(said, only_copy=True)


def _command_line() -> str:
    return " ".join(["capslip", *sys.argv[1:]])
