"""Files and folders that cannot be read, and paths that are no files: each is named with its reason."""

from __future__ import annotations

import os

import pytest
from bevameter.framework.core.classifier.labelled import read_labelled
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording.camera import read_image
from bevameter.framework.core.recording.readers import read_recording
from bevameter.framework.core.recording.sound import SoundFileStream
from bevameter.framework.core.recording.tables import read_table


@pytest.fixture
def loop(tmp_path):
    """A link that leads to itself, in a labelled folder."""
    for name in ("sand", "clay"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "a.csv").write_text(f"{name}\n")
    path = tmp_path / "sand" / "loop.csv"
    try:
        path.symlink_to(path.name)
    except OSError:
        pytest.skip("this system makes no symbolic links")
    return path


@pytest.fixture
def shut(tmp_path):
    """A folder without read permission, with a file in it."""
    folder = tmp_path / "shut"
    folder.mkdir()
    (folder / "a.csv").write_text("time_s\n")
    folder.chmod(0)
    if os.access(folder, os.R_OK):
        folder.chmod(0o700)
        pytest.skip("this user may read everything")
    yield folder
    folder.chmod(0o700)


READERS = [read_image, SoundFileStream, read_table, read_recording]


@pytest.mark.parametrize("read", READERS)
def test_a_link_that_leads_to_itself(read, loop):
    with pytest.raises(InputError, match=r"loop\.csv: a link that leads to itself"):
        read(loop)


@pytest.mark.parametrize("read", READERS)
def test_a_file_in_a_folder_without_permission(read, shut):
    with pytest.raises(InputError, match=r"a\.csv: Permission denied"):
        read(shut / "a.csv")


@pytest.mark.parametrize("read", READERS[:3])
def test_a_path_that_is_no_file_is_reported(read, tmp_path):
    (tmp_path / "x.csv").mkdir()
    with pytest.raises(InputError, match=r"x\.csv: a folder"):
        read(tmp_path / "x.csv")
    if hasattr(os, "mkfifo"):
        os.mkfifo(tmp_path / "pipe.csv")
        with pytest.raises(InputError, match=r"pipe\.csv: a pipe or a device"):
            read(tmp_path / "pipe.csv")


def test_a_labelled_folder_with_a_link_to_itself_leaves_it_to_the_reader(loop):
    folder = loop.parents[1]
    assert loop in [item.file for item in read_labelled(folder)]
    (folder / "index.csv").write_text("file,class,group\nsand/a.csv,sand,1\nsand/loop.csv,clay,2\n")
    with pytest.raises(InputError, match=r"row 3, column file: no file .*loop\.csv"):
        read_labelled(folder)


def test_a_class_folder_without_permission(shut):
    with pytest.raises(InputError, match="shut: Permission denied"):
        read_labelled(shut.parent)
