"""Files are written whole or not at all, to where a path leads."""

import os
import threading
from operator import methodcaller

import pytest

from capslip.disk import write_whole


def test_a_file_behind_a_link_is_replaced_and_the_link_stays(tmp_path):
    there = tmp_path / "there"
    there.mkdir()
    (there / "page.md").write_text("older")
    link = tmp_path / "page.md"
    link.symlink_to(there / "page.md")
    write_whole(link, methodcaller("write_text", "newer"))
    assert link.is_symlink()
    assert (there / "page.md").read_text() == "newer"
    assert len(list(tmp_path.iterdir())) == 2
    assert len(list(there.iterdir())) == 1


def test_a_link_that_leads_nowhere_leads_to_the_file_then(tmp_path):
    link = tmp_path / "page.md"
    link.symlink_to("other.md")
    write_whole(link, methodcaller("write_text", "newer"))
    assert link.is_symlink()
    assert (tmp_path / "other.md").read_text() == "newer"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes with names here")
def test_a_pipe_is_written_to_and_stays(tmp_path):
    pipe, read = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: read.append(pipe.read_text()), daemon=True)
    reader.start()
    write_whole(pipe, methodcaller("write_text", "newer"))
    reader.join(10.0)
    assert read == ["newer"]
    assert pipe.is_fifo()


def test_what_cannot_be_written_leaves_what_was_there(tmp_path):
    path = tmp_path / "page.md"
    path.write_text("older")

    def fails(unfinished):
        unfinished.write_text("new")
        raise OSError("broken")

    with pytest.raises(OSError, match="broken"):
        write_whole(path, fails)
    assert path.read_text() == "older"
    assert len(list(tmp_path.iterdir())) == 1
