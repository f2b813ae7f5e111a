"""Which scans an average is made of: what two have in common is not averaged."""

import hashlib
import re
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from capslip.errors import SettingsError, printable
from capslip.surface.heightmap import HeightMap

LINE = re.compile(r"(?P<name>.*) \((?P<digest>SHA-256 .+)\)", re.DOTALL)  # of `lines_of`


def lines_of(scan: HeightMap) -> tuple[str, ...]:
    """Return name and digest of a scan and, of a mean, those of all scans that it is made of.

    Examples
    --------
    >>> scan = HeightMap(np.zeros((3, 3)), (1e-4, 1e-4))
    >>> lines_of(scan)[0][:40]
    'surface (SHA-256 of its heights 834a709b'
    """
    origin = scan.origin
    if origin.sha256 is None:
        heights_m = np.ascontiguousarray(scan.height_m)
        digest = f"of its heights {hashlib.sha256(heights_m.tobytes()).hexdigest()}"
    else:
        digest = origin.sha256 if origin.dataset is None else f"{origin.sha256}, {origin.dataset}"
    name = origin.name if origin.path is None else re.split(r"[\\/]", origin.path)[-1]
    return (printable(f"{name} (SHA-256 {digest})"), *origin.mean_of)


def refuse_shared(scans: Sequence[HeightMap]) -> None:
    """Refuse averages that are made of one scan: its noise is in both, and counts as none's.

    Scans that are no averages are told apart by their heights.

    Raises
    ------
    SettingsError
        If a scan is in two of them.
    """
    held = [_by_digest(lines_of(one)) for one in scans]
    for (one, in_one), (other, in_other) in combinations(zip(scans, held, strict=True), 2):
        both = sorted(in_one[digest] for digest in in_one.keys() & in_other.keys())
        if both and (one.origin.mean_of or other.origin.mean_of):
            raise SettingsError(
                f"{one.origin.name} and {other.origin.name}: {', '.join(both)} in both, and so the "
                "noise of it; expected averages without a scan in common; give the scans themselves"
            )


def _by_digest(lines: Sequence[str]) -> dict[str, str]:
    """Return names by their digests."""
    known = [found for found in map(LINE.fullmatch, lines) if found is not None]
    return {found["digest"]: found["name"] for found in known}
