"""What nobody wrote is known by its name, in whatever letters; what somebody wrote is not."""

import pytest

from capslip.leftovers import is_leftover


@pytest.mark.parametrize(
    "name",
    [
        *(".DS_Store", "__MACOSX", "._caps.csv", "Thumbs.db", "THUMBS.DB", "ehthumbs.db"),
        *("desktop.ini", "Desktop.ini", ".directory", "@eaDir", ".nfs000000000001"),
        *(".~lock.caps.csv#", "~$batch.xlsx", ".fuse_hidden0001"),
    ],
)
def test_what_nobody_wrote(name):
    assert is_leftover(name)


@pytest.mark.parametrize(
    "name", ["thumbs.db.h5", "DS_Store", "my desktop.ini", ".hidden", "~face.x3p", "a._b", ".lock"]
)
def test_what_somebody_may_have_written(name):
    assert not is_leftover(name)
