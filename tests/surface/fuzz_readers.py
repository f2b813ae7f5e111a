"""Fuzzing of the readers: valid files of every built-in format, damaged in thousands of ways.

A damaged file may still be read, or be refused with an error of the project. Any other error, and
any file that takes more than a second of processor time, is a failure.
"""

import contextlib
import io
import tempfile
import time
import warnings
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from written import writers

from capslip.errors import CapslipError
from capslip.surface.heightmap import HeightMap
from capslip.surface.readers import load_surface
from capslip.surface.readers.hdf5 import write_hdf5

SLOW_S = 1.0
VENDOR_SLOW_S = 20.0
VENDOR_FILES = (
    *(f"channels/{name}" for name in ("di-1.di", "spot_1-1000nm.ibw", "al3d-1.al3d")),
    "channels/example_ps.tiff",
    "laser_textured_grooves_leica_dcm3d.plu",
    "milled_like_arcs_1.opd",
    "plate_30x60mm_missing27pct.frt",
    "conformance/zygo_metropro_phase_res1.dat",
)
OF_KNOWN_LENGTH = (  # text says how many numbers there are, not how many digits they have
    *("a.h5", "a.npy", "a.npz", "five.mat", "seven.mat", "a.x3p"),
    *("a.tif", "binary.sdf", "a.gwy", "a.sur", "a.nms"),
)
SHAPE = (9, 11)
CALIBRATED = (
    "hdf5",
    "x3p",
    "sdf",
    "gwyddion",
    "gwy",
    "sur",
    "sxm",
    "nms",
    "zygo",
    "wyko",
    "keyence",
)  # their files say their units
TOKENS = (b"nan", b"-", b"1e999", b"Bad", b",", b";", b"\t", b"\n", b"#", b"999999999999", b"=")
NUMBERS = (0, 1, 0x7F, 0x80, 0xFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF, 1 << 40, (1 << 63) - 1)


@dataclass(frozen=True)
class FuzzResult:
    """What became of the damaged files of one format.

    Attributes
    ----------
    name : str
        The format.
    n_mutants, n_read, n_refused : int
        Damaged files, those read all the same, and those refused with an error of the project.
    failures : tuple of str
        Each with the number of the mutant: another error, a warning, or too slow.
    slowest_s : float
        The longest processor time that one file took.
    """

    name: str
    n_mutants: int
    n_read: int
    n_refused: int
    failures: tuple[str, ...]
    slowest_s: float


def fuzz_readers(n_mutants: int, seed: int = 0) -> tuple[FuzzResult, ...]:
    """Damage valid files of every built-in format and read them.

    Parameters
    ----------
    n_mutants : int
        Damaged files a format.
    seed : int
        Of the damage: the same files every time.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _warm_up(folder)
        return tuple(
            _fuzz(name, files, folder, n_mutants, seed, SLOW_S, calibration(name))
            for name, files in valid_files(folder).items()
        )


def fuzz_vendor(n_mutants: int, scans: Path, seed: int = 0) -> tuple[FuzzResult, ...]:
    """Damage files of instrument makers, of which the library of the extra reads most.

    Parameters
    ----------
    n_mutants : int
        Damaged files a format.
    scans : path
        The folder of real scans; without it there is nothing to damage.
    seed : int
        Of the damage.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        return tuple(
            _fuzz(
                Path(file).suffix[1:],
                [(scans / file).read_bytes()],
                folder,
                n_mutants,
                seed,
                VENDOR_SLOW_S,
                {},
            )
            for file in VENDOR_FILES
            if (scans / file).is_file()
        )


def changed_in_silence(
    path: Path, content: bytes, n_mutants: int, seed: int, given: dict[str, Any]
) -> list[str]:
    """Insert or remove bytes of a file; return each that changed the map without a word.

    Parameters
    ----------
    path : path
        Where the mutants are written, under the name that the format needs.
    content : bytes
        A file whose length is known from its header.
    n_mutants, seed : int
        Their number, half of them near the header, and the seed of the damage.
    given : dict
        Keywords of `load_surface`.
    """
    path.write_bytes(content)
    sound = load_surface(path, **given)
    rng = np.random.default_rng([seed, *path.name.encode()])
    changed = []
    for number in range(n_mutants):
        end = len(content) if number % 2 else min(2000, len(content))
        at, size = int(rng.integers(end + 1)), int(rng.integers(1, 17))
        added = rng.bytes(size) if number % 4 < 2 else b""
        path.write_bytes(content[:at] + added + content[at + (0 if added else size) :])
        try:
            surface = load_surface(path, **given)
        except CapslipError:
            continue
        same = np.array_equal(surface.height_m, sound.height_m, equal_nan=True)
        told = any("belong to no tag" in note for note in surface.origin.notes)
        if not told and not (same and surface.pixel_size_m == sound.pixel_size_m):
            changed.append(f"{path.name}: {len(added) - size * (not added)} bytes at {at}")
    return changed


def fuzz_lengths(n_mutants: int, scans: Path, seed: int = 0) -> list[str]:
    """Return what `changed_in_silence` finds in makers' files and in built-in binary formats."""
    with tempfile.TemporaryDirectory() as name:
        files: dict[Path, tuple[bytes, dict[str, Any]]] = {}
        for file, (write, given) in writers().items():
            if file in OF_KNOWN_LENGTH:
                write(Path(name) / file, np.random.default_rng(5).normal(size=(6, 8)))
                files[Path(name) / file] = (Path(name) / file).read_bytes(), given
        for file in (*VENDOR_FILES, "polished_disc_with_tracks.sur"):
            if (scans / file).is_file():
                files[Path(name) / Path(file).name] = (scans / file).read_bytes(), {}
        return [
            one
            for path, (content, given) in files.items()
            for one in changed_in_silence(path, content, n_mutants, seed, given)
        ]


def calibration(name: str) -> dict[str, Any]:
    """Return what the valid files of a format do not say, as keywords of `load_surface`."""
    if name in CALIBRATED:
        return {}
    lengths = {"unit": "um", "lateral_unit": "um"}
    return (
        lengths
        if name in ("xyz", "mesh", "esri", "surfer")
        else {**lengths, "pixel_size": (2.0, 1.0)}
    )


def valid_files(folder: Path) -> dict[str, list[bytes]]:
    """Return the contents of valid files of every built-in format, written in a folder."""
    heights = np.random.default_rng(1).normal(0.0, 1e-6, SHAPE)
    heights[2, 3:5] = np.nan
    matrix = 1e6 * heights
    return {
        "hdf5": _written(folder, _hdf5(heights)),
        "npy": [_saved(np.save, matrix), _saved(np.save, np.asfortranarray(matrix))],
        "npz": [_saved(np.savez, matrix), _saved(np.savez_compressed, matrix)],
        "x3p": _written(folder, _x3p(heights)),
        "sdf": [*_sdf_binary(matrix), _sdf_text(matrix)],
        "mat": [_mat(matrix, False), _mat(matrix, True), *_written(folder, _mat_hdf5(matrix))],
        "tiff": _written(folder, _tiff(matrix)),
        "gwyddion": _gwyddion(matrix),
        "xyz": _xyz(matrix),
        "text": _text(matrix),
        **_of_others(folder, np.where(np.isnan(matrix), 0.0, matrix)),
    }


def _of_others(folder: Path, matrix: np.ndarray) -> dict[str, list[bytes]]:
    names = {
        "gwy": ("a.gwy",),
        "sur": ("a.sur",),
        "sxm": ("up.sxm", "down.sxm"),
        "nms": ("a.nms",),
        "zygo": ("zygo.txt",),
        "wyko": ("wyko.asc",),
        "keyence": ("keyence.csv",),
        "esri": ("a.asc",),
        "surfer": ("a.grd",),
        "mesh": ("a.ply",),
    }
    write = {name: write for name, (write, _) in writers().items()}
    return {
        name: _written(folder, [lambda path, f=file: write[f](path, matrix) for file in files])
        for name, files in names.items()
    }


def _warm_up(folder: Path) -> None:
    """Import the libraries of every format, so that no mutant is charged for it."""
    for name, files in {**valid_files(folder), "nothing": [b"no scan"]}.items():
        path = folder / f"valid.{name}"
        path.write_bytes(files[0])
        with contextlib.suppress(CapslipError):
            load_surface(path, **calibration(name))


def _fuzz(
    name: str,
    files: list[bytes],
    folder: Path,
    n_mutants: int,
    seed: int,
    slow_s: float,
    given: dict[str, Any],
) -> FuzzResult:
    rng = np.random.default_rng([seed, *name.encode()])
    path = folder / f"mutant.{name}"
    n_read = n_refused = 0
    slowest_s = 0.0
    failures = []
    for number in range(n_mutants):
        path.unlink(missing_ok=True)  # some file systems flush a file that is written over
        path.write_bytes(_damaged(files[number % len(files)], rng))
        started = time.process_time()
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                surface = load_surface(path, **given, lenient=True)
            n_read += isinstance(surface, HeightMap)
        except CapslipError:
            n_refused += 1
        except Exception as error:  # what is looked for
            failures.append(f"{number}: {type(error).__name__}: {error}")
        took_s = time.process_time() - started
        slowest_s = max(slowest_s, took_s)
        if took_s > slow_s:
            failures.append(f"{number}: took {took_s:.1f} s")
    return FuzzResult(name, n_mutants, n_read, n_refused, tuple(failures), slowest_s)


def _damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """Damage a file; an archive as often inside its members as outside."""
    if content.startswith(b"PK") and rng.random() < 0.6:
        return _damaged_inside(content, rng)
    for _ in range(rng.integers(1, 4)):
        content = _damaged_once(content, rng)
    return content


def _damaged_inside(content: bytes, rng: np.random.Generator) -> bytes:
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    victim = list(members)[rng.integers(len(members))]
    rename = rng.random() < 0.1
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, member in members.items():
            if name == victim:
                member = _damaged_once(member, rng)
                name = f"{('folder/', '../', '/', '__MACOSX/')[rng.integers(4)]}{name}" * rename
            archive.writestr(name or victim, member)
    return packed.getvalue()


def _damaged_once(content: bytes, rng: np.random.Generator) -> bytes:
    # Headers are short and decide most, so half of the damage falls on the first 200 bytes.
    end = len(content) if rng.random() < 0.5 else min(200, len(content))
    at = int(rng.integers(0, max(end, 1)))
    size = int(rng.integers(1, 17))
    number = NUMBERS[rng.integers(len(NUMBERS))]
    token = TOKENS[rng.integers(len(TOKENS))]
    width = int(rng.choice([1, 2, 4, 8]))
    packed = (number % 256**width).to_bytes(width, ("little", "big")[rng.integers(2)])
    kinds: tuple[Callable[[], bytes], ...] = (
        lambda: content[:at],
        lambda: content[:at] + content[at + size :],
        lambda: content[:at] + rng.bytes(size) + content[at + size :],
        lambda: content[:at] + rng.bytes(size) + content[at:],
        lambda: content[:at] + content[at : at + 10 * size] + content[at:],
        lambda: content[:at] + packed + content[at + width :],
        lambda: content[:at] + token + content[at:],
        lambda: content[:at] + token + content[at + len(token) :],
        lambda: content[:at] + bytes([content[at] ^ (1 << size % 8)]) + content[at + 1 :],
    )
    return kinds[rng.integers(len(kinds))]() if content else content


def _written(folder: Path, writers: list[Callable[[Path], object]]) -> list[bytes]:
    contents = []
    for write in writers:
        path = folder / "valid"
        write(path)
        contents.append(path.read_bytes())
        path.unlink()
    return contents


def _saved(save: Callable[..., None], array: np.ndarray) -> bytes:
    file = io.BytesIO()
    save(file, array)
    return file.getvalue()


def _hdf5(heights: np.ndarray) -> list[Callable[[Path], object]]:
    import h5py

    surface = HeightMap(heights, (2e-6, 1e-6))

    def plain(path: Path) -> None:
        with h5py.File(path, "w") as file:
            file["height"] = heights
            file["height"].attrs.update(unit="m", pixel_size=[2e-6, 1e-6], pixel_unit="m")

    return [lambda path: write_hdf5(surface, path), plain]


def _x3p(heights: np.ndarray) -> list[Callable[[Path], object]]:
    import x3pio

    surface = x3pio.Surface.from_array(heights, x_scale=1e-6, y_scale=2e-6)
    return [
        lambda path: surface.save(path, storage=x3pio.DataStorage.BINARY),
        lambda path: surface.save(path, storage=x3pio.DataStorage.XML),
        lambda path: x3pio.write(
            path, heights, x_scale=1e-6, y_scale=2e-6, z_type=x3pio.DataType.INT16
        ),
    ]


def _sdf_binary(matrix: np.ndarray) -> list[bytes]:
    ny, nx = matrix.shape
    contents = []
    for code, kind in ((3, "<f4"), (5, "<i2"), (7, "<f8")):
        raw = np.where(np.isnan(matrix), -30000 if code == 5 else 0, matrix).astype(kind)
        counts = np.array([nx, ny], "<u2").tobytes()
        scales = np.array([1e-6, 2e-6, 1e-6, -1.0], "<f8").tobytes()
        head = b"bISO-1.0" + b"capslip   " + 2 * b"010120260000" + counts + scales
        contents.append(head + bytes([0, code, 0]) + raw.tobytes())
    return contents


def _sdf_text(matrix: np.ndarray) -> bytes:
    ny, nx = matrix.shape
    fields = (
        f"NumPoints = {nx}\nNumProfiles = {ny}\nXscale = 1e-6\nYscale = 2e-6\nZscale = 1e-6\n"
        "Zresolution = 0\nCompression = 0\nDataType = 7\nCheckType = 0\n"
    )
    rows = _rows(matrix, " ").replace("nan", "BAD")
    return f"aBCR-1.0\nManufacID = capslip\n{fields}*\n{rows}*\n".encode()


def _mat(matrix: np.ndarray, packed: bool) -> bytes:
    from scipy.io import savemat

    file = io.BytesIO()
    savemat(file, {"z": matrix, "about": "heights"}, do_compression=packed)
    return file.getvalue()


def _mat_hdf5(matrix: np.ndarray) -> list[Callable[[Path], object]]:
    import h5py

    def write(path: Path) -> None:
        with h5py.File(path, "w", userblock_size=512) as file:
            file["z"] = matrix.T
        with path.open("r+b") as file:
            file.write(b"MATLAB 7.3 MAT-file".ljust(512))

    return [write]


def _tiff(matrix: np.ndarray) -> list[Callable[[Path], object]]:
    import tifffile

    return [
        lambda path: tifffile.imwrite(path, matrix.astype("f4")),
        lambda path: tifffile.imwrite(path, matrix, compression="zlib", byteorder=">"),
    ]


def _gwyddion(matrix: np.ndarray) -> list[bytes]:
    ny, nx = matrix.shape
    body = _rows(matrix, " ")
    sized = (
        f"h={ny} w={nx}\npixel size=1.0e-006 m\ndata unit=rad\n"
        f"height conversion factor (-> m)=2.9e-008\n{body}"
    )
    commented = f"# Channel: z\n# Width: 11 µm\n# Height: 18 µm\n# Value units: um\n{body}"
    return [sized.encode(), commented.encode()]


def _xyz(matrix: np.ndarray) -> list[bytes]:
    y, x = np.indices(matrix.shape)
    points = np.column_stack([x.ravel(), 2 * y.ravel(), matrix.ravel()])
    off = points + np.random.default_rng(2).uniform(-0.5, 0.5, points.shape) * [1, 2, 0]
    named = "x [um], y [um], z [um]\n" + _rows(points, ", ")
    return [_rows(points, " ").encode(), named.encode(), _rows(off, "\t").encode()]


def _text(matrix: np.ndarray) -> list[bytes]:
    comma = _rows(matrix, ";").replace(".", ",")
    return [*(_rows(matrix, mark).encode() for mark in (" ", "\t", ",", ";")), comma.encode()]


def _rows(matrix: np.ndarray, separator: str) -> str:
    file = io.StringIO()
    np.savetxt(file, matrix, fmt="%.6g", delimiter=separator)
    return file.getvalue()
