"""Meshes and clouds of points: STL, PLY, OBJ and PCD, of which the corners count as points.

A face is seen along z; the points are brought to a grid as those of XYZ are. No unit is stored.
"""

import re
import struct
from collections.abc import Callable
from itertools import chain
from pathlib import Path

import numpy as np

from capslip.errors import UnreadableFileError
from capslip.surface.heightmap import Statement
from capslip.surface.readers.points import grid_points
from capslip.surface.readers.stored import MAX_POINTS, Format, Request, Stored
from capslip.surface.readers.table import parse_numbers

STL_HEAD, STL_FACET = 84, 50
STL_TEXT = re.compile(rb"\s*solid\b[^\n]*\n\s*(facet|endsolid)\b", re.IGNORECASE)
OBJ = re.compile(rb"(?:[ \t]*(?:#[^\n]*|mtllib[^\n]*|[og] [^\n]*|usemtl[^\n]*)?\r?\n)*[ \t]*v[ \t]")
OBJ_POINT = re.compile(rb"^[ \t]*v[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.MULTILINE)
STL_POINT = re.compile(rb"\bvertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.IGNORECASE)
PLY_TYPES = {
    "char": "i1",
    "uchar": "u1",
    "short": "i2",
    "ushort": "u2",
    "int": "i4",
    "uint": "u4",
    "float": "f4",
    "double": "f8",
    "int8": "i1",
    "uint8": "u1",
    "int16": "i2",
    "uint16": "u2",
    "int32": "i4",
    "uint32": "u4",
    "float32": "f4",
    "float64": "f8",
}
ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
MAX_HEADER_BYTES = 2**16


def _recognises(head: bytes, path: Path) -> bool:
    return _kind(head, path) is not None


def _kind(head: bytes, path: Path) -> Callable[[bytes], np.ndarray] | None:
    if head.startswith((b"ply\n", b"ply\r")):
        return _ply
    if head.startswith(b"# .PCD") or re.match(rb"(#[^\n]*\n)*VERSION[^\n]*\nFIELDS ", head):
        return _pcd
    if STL_TEXT.match(head):
        return _stl_text
    size = path.stat().st_size
    if len(head) >= STL_HEAD:
        (n_facets,) = struct.unpack_from("<I", head, 80)
        if n_facets > 0 and size == STL_HEAD + STL_FACET * n_facets:
            return _stl
    if path.suffix.lower() == ".stl":
        return _stl
    return _obj if path.suffix.lower() == ".obj" or OBJ.match(head) else None


def _read(path: Path, request: Request) -> Stored:
    content = path.read_bytes()
    kind = _kind(content[:512], path)
    try:
        points = kind(content) if kind else np.empty((0, 3))
    except (struct.error, ValueError, KeyError, IndexError) as error:
        raise UnreadableFileError(
            f"{path}: damaged, truncated or unsupported mesh ({' '.join(str(error).split())}); "
            "expected points x y z; export it again, or as XYZ"
        ) from error
    # Corners stand in as many triangles as meet there
    points = np.unique(np.asarray(points, dtype=np.float64), axis=0)
    grid = grid_points(points, str(path), request.pixel_size_in(None))
    note = Statement(f"heights are the z of {len(points)} points of the mesh; --unit is that of z")
    return Stored(
        grid.height, pixel_size=grid.pixel_size, notes=(note, *grid.notes), top_row_first=False
    )


def _stl(content: bytes) -> np.ndarray:
    (n_facets,) = struct.unpack_from("<I", content, 80)
    expected = STL_HEAD + STL_FACET * n_facets
    if len(content) != expected:
        raise ValueError(f"{len(content)} bytes, where {n_facets} facets take {expected}")
    facet = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    return np.frombuffer(content, facet, n_facets, STL_HEAD)["corners"].reshape(-1, 3)


def _stl_text(content: bytes) -> np.ndarray:
    n_facets = len(re.findall(rb"\bendfacet\b", content, re.IGNORECASE))
    points = _numbers(STL_POINT.findall(content))
    if len(points) != 3 * n_facets or b"endsolid" not in content[-512:].lower():
        raise ValueError(f"{len(points)} corners of {n_facets} facets")
    return points


def _obj(content: bytes) -> np.ndarray:
    points = _numbers(OBJ_POINT.findall(content))
    n_lines = len(re.findall(rb"^[ \t]*v[ \t]", content, re.MULTILINE))
    if len(points) != n_lines:
        raise ValueError(f"{len(points)} points in {n_lines} lines of points")
    return points


def _numbers(words: list[tuple[bytes, bytes, bytes]]) -> np.ndarray:
    if not words:
        raise ValueError("no points")
    return np.fromiter(map(float, chain.from_iterable(words)), np.float64).reshape(-1, 3)


def _ply(content: bytes) -> np.ndarray:
    end = content.find(b"end_header", 0, MAX_HEADER_BYTES)
    start = content.find(b"\n", end) + 1
    if end < 0 or start == 0:
        raise ValueError("the header has no end")
    elements: list[tuple[str, int, list[list[str]]]] = []
    form = ""
    for words in (line.split() for line in content[:end].decode("latin-1").splitlines()):
        if words[:1] == ["format"]:
            form = words[1]
        elif words[:1] == ["element"]:
            elements.append((words[1], int(words[2]), []))
        elif words[:1] == ["property"] and elements:
            elements[-1][2].append(words[1:])
    name, count, properties = elements[0]
    if name != "vertex" or count > MAX_POINTS or any(p[0] == "list" for p in properties):
        raise ValueError(f"first element {name}; expected the points (vertex)")
    names = [words[1] for words in properties]
    if form == "ascii":
        return _text_columns(content[start:], names, count)
    if form not in ORDERS:
        raise ValueError(f"format {form!r}")
    dtype = np.dtype([(p[1], ORDERS[form] + PLY_TYPES[p[0]]) for p in properties])
    if len(elements) == 1 and len(content) != start + count * dtype.itemsize:
        raise ValueError(f"{len(content) - start} bytes of {count} points")
    return _columns(np.frombuffer(content, dtype, count, start))


def _pcd(content: bytes) -> np.ndarray:
    match = re.search(rb"^DATA[ \t]+(\w+)[ \t]*\r?\n", content[:MAX_HEADER_BYTES], re.MULTILINE)
    if match is None:
        raise ValueError("the header has no line DATA")
    lines = (line.split() for line in content[: match.start()].decode("latin-1").splitlines())
    fields = {words[0]: words[1:] for words in lines if words}
    names, count = fields["FIELDS"], int(fields["POINTS"][0])
    if not 0 <= count <= MAX_POINTS:
        raise ValueError(f"{count} points")
    repeats = [int(n) for n in fields.get("COUNT", ["1"] * len(names))]
    if match.group(1) == b"ascii":
        flat = [
            f"{n} {i}" if r > 1 else n
            for n, r in zip(names, repeats, strict=True)
            for i in range(r)
        ]
        return _text_columns(content[match.end() :], flat, count)
    if match.group(1) != b"binary":
        raise ValueError(f"DATA {match.group(1).decode('latin-1')}; expected ascii or binary")
    sorts = {"F": "f", "I": "i", "U": "u"}
    dtype = np.dtype(
        [
            (f"{name} {at}" if name in "_" else name, f"<{sorts[t]}{size}", (r,) if r > 1 else ())
            for at, (name, t, size, r) in enumerate(
                zip(names, fields["TYPE"], fields["SIZE"], repeats, strict=True)
            )
        ]
    )
    points = _columns(np.frombuffer(content, dtype, count, match.end()))
    return points[np.isfinite(points[:, :2]).all(axis=1)]  # NaN fills organised clouds


def _text_columns(body: bytes, names: list[str], count: int) -> np.ndarray:
    lines = body.split(b"\n", count)[:count]
    values = parse_numbers(b" ".join(lines), "the points")
    if values.size != count * len(names):
        raise ValueError(f"{values.size} numbers of {count} points with {len(names)} each")
    table = values.reshape(count, len(names))
    points = table[:, [names.index(axis) for axis in "xyz"]]
    return points[np.isfinite(points[:, :2]).all(axis=1)]


def _columns(rows: np.ndarray) -> np.ndarray:
    return np.column_stack([rows[axis].astype(np.float64) for axis in "xyz"])


FORMAT = Format(
    name="mesh",
    extensions=(".stl", ".ply", ".obj", ".pcd"),
    reader="built in",
    note="corners of a mesh, or points; needs --unit and --lateral-unit",
    recognises=_recognises,
    read=_read,
)
