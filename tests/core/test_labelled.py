import numpy as np
import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.labelled import read_labelled


@pytest.fixture
def folder(tmp_path):
    for name in ("sand/a.png", "sand/b.PNG", "clay/c.png", "clay/LICENSE.txt", ".cache/x.png"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(b"x")
    return tmp_path


def test_sub_folders_name_the_classes_and_each_file_is_a_group(folder):
    labelled = read_labelled(folder)
    assert [(item.class_name, item.group, item.start_s) for item in labelled] == [
        ("clay", "clay/c.png", None), ("sand", "sand/a.png", None), ("sand", "sand/b.PNG", None),
    ]  # fmt: skip
    assert all(item.file.is_file() for item in labelled)


def test_an_index_gives_classes_groups_stretches_and_more(folder):
    (folder / "index.csv").write_text(
        "file,class,group,start_s,end_s,wheel_file,kind\n"
        "sand/a.png,wet sand,007,0,1.5,sand/b.PNG,photo\nclay/c.png,clay,g,,,,\n"
    )
    first, second = read_labelled(folder)
    assert (first.class_name, first.group, first.start_s, first.end_s) == ("wet sand", "007", 0.0, 1.5)
    assert first.extra["kind"] == "photo"
    assert first.extra["wheel_file"] == (folder / "sand" / "b.PNG").absolute()
    assert (second.start_s, second.end_s, second.extra["wheel_file"]) == (None, None, "")


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("sand/none.png,sand,1", "row 2, column file: no file .*none.png"),
        ("../x.png,sand,1", "row 2, column file: '../x.png' leads out of the folder"),
        ("sand/a.png,,1", "row 2, column class: an empty cell"),
        ("sand/a.png,sand,", "row 2, column group: an empty cell"),
        ("sand/a.png,unknown,1", "row 2, column class: 'unknown'"),
        ("sand/a.png,UnKnown,1", "row 2, column class: 'UnKnown'"),
        ('sand/a.png,"sa\nnd",1', r"row 2, column class: a class named 'sa\\nnd'"),
        ("sand/a.png,Wet sand,1\nsand/b.PNG,wetsand,2", "classes 'Wet sand' and 'wetsand'"),
        ("sand/a.png,sand,1\nsand/b.PNG,sand,1", "one class only, 'sand'"),
        ("", "a header without rows"),
    ],
)
def test_what_is_wrong_with_an_index_is_named(rows, says, folder):
    (folder / "index.csv").write_text(f"file,class,group\n{rows}\n")
    with pytest.raises(InputError, match=says):
        read_labelled(folder)


@pytest.mark.parametrize(
    ("header", "row", "says"),
    [
        ("file,label,group", "sand/a.png,sand,1", "no column class; there are file, label, group"),
        ("file,class", "sand/a.png,sand", "no column group"),
        ("file,class,group,start_s", "sand/a.png,sand,1,soon", "row 2, column start_s: 'soon'"),
        ("file,class,group,start_s", "sand/a.png,sand,1,-1", "row 2, column start_s: -1"),
        ("file,class,group,start_s,end_s", "sand/a.png,sand,1,2,1", "row 2, column end_s: 2 s to 1 s"),
        ("file,class,group,wheel_file", "sand/a.png,sand,1,p.csv", "row 2, column wheel_file: no file"),
    ],
)
def test_wrong_columns_and_stretches_are_named(header, row, says, folder):
    (folder / "index.csv").write_text(f"{header}\n{row}\n")
    with pytest.raises(InputError, match=says):
        read_labelled(folder)


def test_what_is_no_labelled_folder(tmp_path):
    with pytest.raises(InputError, match="no such folder"):
        read_labelled(tmp_path / "none")
    with pytest.raises(InputError, match=r"neither index\.csv nor"):
        read_labelled(tmp_path)
    (tmp_path / "sand").mkdir()
    (tmp_path / "sand" / "a.wav").write_bytes(b"x")
    with pytest.raises(InputError, match="one class only, 'sand'"):
        read_labelled(tmp_path)
    with pytest.raises(InputError, match="a file"):
        read_labelled(tmp_path / "sand" / "a.wav")


@pytest.mark.parametrize(
    ("name", "says"),
    [("Unknown", "Unknown: 'Unknown'"), ("Sand", "'Sand' and 'sand'"), ("sand ", "'sand' and 'sand '")],
)
def test_folders_whose_names_no_class_may_have(name, says, folder):
    try:
        (folder / name).mkdir()
    except FileExistsError:
        pytest.skip("file system without case or trailing spaces")
    (folder / name / "d.png").write_bytes(b"d")
    with pytest.raises(InputError, match=says):
        read_labelled(folder)


@pytest.mark.parametrize(
    ("name", "n", "classes"),
    [("vehicle-vibration", 48, 5), ("contact-sound/nox", 280, 12), ("contact-sound/minetest", 32, 11),
     ("ground-photos", 170, 10), ("ground-photos/large", 48, 9)],
)  # fmt: skip
def test_real_labelled_folders(name, n, classes, shared_data):
    labelled = read_labelled(shared_data / name)
    assert (len(labelled), len({item.class_name for item in labelled})) == (n, classes)
    assert np.all([item.file.is_file() for item in labelled])
