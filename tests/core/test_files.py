"""Files are written whole or not at all, never over an input, and a path that is no regular file is kept."""

from __future__ import annotations

import os
import threading
import tomllib
from pathlib import Path

import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.files import check_outputs, toml_string, write_text
from hypothesis import example, given
from hypothesis import strategies as st


def test_no_result_is_written_over_what_is_read(tmp_path):
    source = tmp_path / "wheel.csv"
    source.write_text("slip\n0.1\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"over .*wheel\.csv, which is read"):
        check_outputs([None, source], [source, None])
    (tmp_path / "link.json").symlink_to(source)
    with pytest.raises(InputError, match="which is read"):
        check_outputs([tmp_path / "link.json"], [source])
    with pytest.raises(InputError, match="which is read"):
        check_outputs([source], [tmp_path])
    result = tmp_path / "answer.json"
    result.write_text("{}", encoding="utf-8")
    check_outputs([result, tmp_path / "page.html", None], [tmp_path, source])


def test_two_results_need_two_files(tmp_path):
    with pytest.raises(InputError, match="two results"):
        check_outputs([tmp_path / "same", tmp_path / "." / "same"], [])


def test_a_link_is_followed(tmp_path):
    target, link = tmp_path / "kept" / "answer.json", tmp_path / "link.json"
    target.parent.mkdir()
    link.symlink_to(target)
    write_text("new", link)
    assert link.is_symlink()
    assert target.read_text(encoding="utf-8") == "new"
    assert os.listdir(target.parent) == ["answer.json"]


def test_a_pipe_is_written_to(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    heard: list[str] = []
    reader = threading.Thread(target=lambda: heard.append(pipe.read_text(encoding="utf-8")))
    reader.start()
    write_text("through", pipe)
    reader.join(5.0)
    assert heard == ["through"]
    assert pipe.is_fifo()


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_device_is_an_error_and_is_kept():
    with pytest.raises(InputError, match="/dev/full: cannot be written: No space left"):
        write_text("lost", Path("/dev/full"))
    assert Path("/dev/full").is_char_device()


def test_a_folder_that_takes_no_files_is_one_line(tmp_path):
    if not Path("/proc/self").exists():
        pytest.skip("no file system that makes no files")
    with pytest.raises(InputError, match="cannot be written"):
        write_text("lost", Path("/proc/answer.json"))


@given(st.text())
@example('/wheel\n[camera]\ntopic = "x" \\ \x7f \ud800')
def test_any_text_is_a_string_of_toml_and_fit_for_a_remark(text):
    """Names of topics and columns are whatever a file says; a surrogate, which is no text, becomes a question mark."""
    written = toml_string(text)
    read = tomllib.loads(f"a = {written}  # {written}\nb = 1\n")
    assert read == {"a": text.encode("utf-8", "replace").decode(), "b": 1}
