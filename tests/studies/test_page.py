"""What every study writes is whole, or as it was."""

import pytest

from capslip.errors import OutputError
from capslip.studies.page import write


def test_a_full_disk_leaves_the_older_page(tmp_path, half_written):
    write(tmp_path, {"page.md": "older", "page.png": b"older"})
    half_written("write_bytes")
    with pytest.raises(OutputError, match="No space left on device; make room on its disk, or ch"):
        write(tmp_path, {"page.md": "newer", "page.png": b"newer"})
    assert {one.name: one.read_bytes() for one in tmp_path.iterdir()} == {
        "page.md": b"older",
        "page.png": b"older",
    }
