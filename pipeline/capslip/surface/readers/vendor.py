"""Formats of instrument makers, read by SurfaceTopography (optional extra `vendor`)."""

import logging
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from capslip.errors import CapslipError, UncalibratedError, UnreadableFileError
from capslip.surface.readers.choice import choose, note_of_choice, unique_names
from capslip.surface.readers.hdf5_items import check_file
from capslip.surface.readers.lengths import check_length
from capslip.surface.readers.stored import (
    Format,
    Request,
    Stored,
    check_positive,
    check_shape,
    is_length,
    read_head,
)

HDF5_MAGIC = b"\x89HDF\r\n\x1a\n"  # inside DATX and netCDF
# hgt has no header: every file of a fitting size passes for it. The others are built in: what
# their own readers did not recognise is damaged, and the library would read it less strictly.
PICTURE = "a picture, whose grey values are no heights"
ARCHIVE = "an archive or a sheet of an office program; unpack it, or save the sheet as CSV"
KNOWN = {  # what is no map in any format, by its first bytes
    b"\x89PNG": PICTURE,
    b"\xff\xd8\xff": PICTURE,
    b"GIF8": PICTURE,
    b"BM": PICTURE,
    b"PK": ARCHIVE,
    b"BZh": ARCHIVE,
    b"7z\xbc\xaf": ARCHIVE,
    b"\xfd7zXZ": ARCHIVE,
    b"\xd0\xcf\x11\xe0": ARCHIVE,
    b"version https://git-lfs": "a pointer of Git LFS, not the file; fetch it with `git lfs pull`",
}
FACTORS = {  # of the heights; the library takes any, and 1 for one that is missing
    "bcr": ("bit2nm",),
    "metropro": ("intf_scale_factor", "wavelength_in", "obliquity_factor"),
    "opd": ("Wavelength", "Mult"),
}
NETCDF = "nc"  # alone has coordinates of its own
NO_FORMAT = ("hgt", "asc", "gwy", "h5", "mat", "nms", "npy", "npz", "sdf", "sur", "x3p", "xyz")


def _recognises(head: bytes, path: Path) -> bool:
    return True  # the last in the registry: everything that nothing else recognised


def _read(path: Path, request: Request) -> Stored:
    with warnings.catch_warnings():
        # The library warns of optional parts that this use does not need, and one of its parsers
        # logs the whole content of a file that is not its own.
        warnings.simplefilter("ignore")
        logging.getLogger("igor2").setLevel(logging.CRITICAL + 1)
        try:
            from SurfaceTopography import open_topography
            from SurfaceTopography.Exceptions import CannotDetectFileFormat
        except ImportError as error:
            raise UnreadableFileError(
                f"{path}: in no format that is built in; formats of instrument makers need an "
                "optional library; install capslip[vendor], or convert the file to X3P, SDF, XYZ "
                "or HDF5"
            ) from error
        lengths = check_length(path, request.lenient)
        if read_head(path, len(HDF5_MAGIC)) == HDF5_MAGIC:
            check_file(path)
        try:
            with open_topography(str(path)) as reader:
                stored = _stored(reader, path, request.dataset)
            return replace(stored, notes=lengths + stored.notes)
        except CapslipError:
            raise
        except CannotDetectFileFormat as error:
            raise _unknown(path) from error
        except Exception as error:  # forty parsers on damaged bytes raise errors of every kind
            raise UnreadableFileError(
                f"{path}: damaged, truncated or unsupported "
                f"({type(error).__name__}: {' '.join(str(error).split())[:200]}); "
                "export it again, or as X3P"
            ) from error


def _unknown(path: Path) -> UnreadableFileError:
    head = read_head(path, 64)
    known = next((f" ({what})" for magic, what in KNOWN.items() if head.startswith(magic)), "")
    return UnreadableFileError(
        f"{path}: not a height map in a format that is known{known}; expected one of "
        "`capslip formats`; export it as X3P or HDF5"
    )


def _stored(reader: Any, path: Path, dataset: str | None) -> Stored:
    kind = reader.format()
    if kind in NO_FORMAT:
        raise _unknown(path)
    names = unique_names([channel.name for channel in reader.channels])
    maps = _maps_of_heights(reader)
    profiles = reader.channels and all(channel.dim != 2 for channel in reader.channels)
    chosen = 0 if profiles and dataset is None else choose(dataset, names, maps, path)
    channel = reader.channels[chosen]
    if channel.dim != 2:
        raise UnreadableFileError(
            f"{path}: {names[chosen]!r} is a profile along one axis; expected a height map with "
            "two; export the whole scan"
        )
    if chosen not in maps:
        raise UncalibratedError(
            f"{path}: channel {names[chosen]!r} is in {_unit_of_values(channel)}; expected heights "
            "in a unit of length; choose another one with --dataset"
        )
    if kind in FACTORS:
        _check_factors(FACTORS[kind], channel.info["raw_metadata"], path)
    nx, ny = channel.nb_grid_pts
    check_shape((ny, nx), str(path))
    size = channel.physical_sizes
    axes, way_y, way_x = _axes(path) if kind == NETCDF else (("x", "y"), -1, 1)
    topography = reader.topography(
        channel_index=channel.index, physical_sizes=(nx, ny) if size is None else None
    )
    if not topography.is_uniform:
        raise UnreadableFileError(f"{path}: no regular grid; expected one; resample the scan")
    heights = np.ma.filled(np.ma.asarray(topography.heights(), dtype=np.float64), np.nan)
    heights = heights.T if axes == ("x", "y") else heights
    unit = topography.unit
    return Stored(
        height=heights[:, ::way_x],
        unit=unit,
        pixel_size=None if size is None else (size[1] / ny, size[0] / nx),
        lateral_unit=None if size is None else unit,
        notes=note_of_choice(dataset, names, maps),
        top_row_first=way_y < 0,
        dataset=names[chosen] if len(names) > 1 else None,
    )


def _check_factors(names: tuple[str, ...], said: dict[str, Any], path: Path) -> None:
    """Refuse a factor of the heights that is missing or no positive number."""
    if str(said.get("fileformat")).startswith("bcrf"):
        return  # real numbers, which are heights
    for name in names:
        if name in said or name != "Mult":  # which Vision leaves out where it is 1
            check_positive(said.get(name), name, str(path))


def _axes(path: Path) -> tuple[tuple[str, ...], int, int]:
    """Return the axes of the heights of a NetCDF file, and whether y and x grow (1) or fall (-1).

    The library takes the first axis of any map for x, which in most such files is y. Ways that the
    file does not say are as in every other format: the library turns a map as it is drawn, from
    the top down.
    """
    from scipy.io import netcdf_file

    with netcdf_file(str(path), maskandscale=True) as file:
        said = file.variables
        axes, *others = (said[name].dimensions for name in ("heights", "mask") if name in said)
        y, x = (said[name][:] if name in said else np.zeros(1) for name in "yx")
    if sorted(axes) != ["x", "y"] or any(one != axes for one in others):
        along = "; mask ".join(f"({', '.join(one)})" for one in (axes, *others))
        raise UnreadableFileError(
            f"{path}: heights {along}; expected heights (y, x) or (x, y), and the mask alike; "
            "export a map along these two"
        )
    return axes, 1 if y[-1] > y[0] else -1, -1 if x[-1] < x[0] else 1


def _maps_of_heights(reader: Any) -> list[int]:
    """Return the indices of the maps that are in a unit of length, or whose unit is not said."""
    default = reader.default_channel.index if reader.channels else None
    maps = [c.index for c in reader.channels if c.dim == 2 and _may_be_length(c)]
    return sorted(maps, key=lambda index: (index != default, index))


def _may_be_length(channel: Any) -> bool:
    if isinstance(channel.unit, tuple):  # of x and y, then of the values, where these differ
        return channel.unit[1] is not None and is_length(channel.unit[1])
    return bool(channel.is_height_channel)


def _unit_of_values(channel: Any) -> str:
    unit = channel.unit[1] if isinstance(channel.unit, tuple) else channel.data_unit
    return str(unit or "no unit of length")


FORMAT = Format(
    name="vendor",
    extensions=(
        ".al3d",
        ".bcr",
        ".datx",
        ".dat",
        ".frt",
        ".lext",
        ".mnt",
        ".opd",
        ".opdx",
        ".plu",
        ".plux",
        ".ibw",
        ".jpk",
        ".spm",
        ".tmd",
        ".vk4",
        ".zon",
    ),
    reader="SurfaceTopography (capslip[vendor])",
    note="about 40 formats of instrument makers, recognised by content",
    recognises=_recognises,
    read=_read,
    named=True,
)
