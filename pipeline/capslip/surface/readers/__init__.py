"""Readers of scan files: one file a format, and the registry that chooses between them."""

from pathlib import Path

from capslip.errors import SettingsError, UnreadableFileError
from capslip.provenance import sha256_of
from capslip.surface.heightmap import HeightMap, Origin
from capslip.surface.readers import gwyddion, hdf5, mat, npy, sdf, text, tiff, vendor, x3p, xyz
from capslip.surface.readers.stored import Format, Request, calibrate, read_head

FORMATS: tuple[Format, ...] = (  # asked in this order
    hdf5.FORMAT,
    npy.FORMAT,
    x3p.FORMAT,
    sdf.FORMAT,
    mat.FORMAT,
    tiff.FORMAT,
    gwyddion.FORMAT,
    xyz.FORMAT,
    text.FORMAT,
    vendor.FORMAT,
)
HEAD_BYTES = 512


def load_surface(
    path: str | Path,
    *,
    unit: str | None = None,
    lateral_unit: str | None = None,
    pixel_size: tuple[float, float] | None = None,
    dataset: str | None = None,
    lenient: bool = False,
) -> HeightMap:
    """Read a scan file as a height map in metres.

    The format is recognised by content. What the file does not say has to be given; what it does
    say is never overridden.

    Parameters
    ----------
    path : path
        The scan.
    unit : {"m", "cm", "mm", "um", "nm", "pm", "inch"}, optional
        Unit of the heights.
    lateral_unit : str, optional
        Unit of the pixel size, one of the same words.
    pixel_size : (float, float), optional
        (dy, dx) in `lateral_unit`, which then has to be given too. For a point cloud, which has
        no pixels of its own, the size of the cells of the grid.
    dataset : str, optional
        Name of the dataset (HDF5), array (NPZ), variable (MAT) or channel (vendor formats) that
        holds the heights.
    lenient : bool, optional
        Accept an X3P archive with its files in a subfolder, with entries that an archiver added,
        or with a wrong checksum. Each leniency used is said in `origin.notes`.

    Returns
    -------
    HeightMap
        float64, shape (ny, nx), NaN at non-measured points. `origin.notes` says what the reader
        did beyond reading.

    Raises
    ------
    UnreadableFileError
        If there is no such file, or it is not a height map in a known format, or is damaged.
    UncalibratedError
        If a unit or the pixel size is neither stored nor given, or contradicts the file.
    UnusableSurfaceError
        If the map has fewer than 3 points along an axis or holds an infinite height.
    SettingsError
        If a unit, pixel size or dataset that is given makes no sense.
    """
    path = Path(path)
    head = _head(path)
    sha256 = sha256_of(path)
    file_format = next(f for f in FORMATS if f.recognises(head, path))
    if dataset is not None and not file_format.named:
        raise SettingsError(
            f"{path}: --dataset {dataset} given, but a file of the format {file_format.name} "
            "holds one height map; leave it out"
        )
    stored = file_format.read(path, Request(dataset, pixel_size, lateral_unit, lenient))
    if not path.is_file() or sha256_of(path) != sha256:  # the digest is that of the bytes read
        raise UnreadableFileError(f"{path}: changed while it was read; analyse it when it is whole")
    origin = Origin(name=path.stem, path=str(path), sha256=sha256, file_format=file_format.name)
    return calibrate(stored, origin, unit, lateral_unit, pixel_size)


def _head(path: Path) -> bytes:
    try:
        if path.is_dir():
            raise UnreadableFileError(f"{path}: is a folder; expected a scan file; name one in it")
        head = read_head(path, HEAD_BYTES)
    except FileNotFoundError as error:
        raise UnreadableFileError(f"{path}: no such file; check the path") from error
    except OSError as error:
        raise UnreadableFileError(f"{path}: cannot be read ({error.strerror})") from error
    if not head:
        raise UnreadableFileError(f"{path}: zero bytes; expected a scan; copy the file again")
    return head
