import numpy as np
import pytest
from bevameter.framework.core.classifier.labelled import read_labelled
from bevameter.framework.core.errors import InputError


@pytest.fixture
def folder(tmp_path):
    for name in ("sand/a.png", "sand/b.PNG", "clay/c.png", "clay/LICENSE.txt", ".cache/x.png"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_bytes(name.encode())
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


def test_folders_that_are_not_labelled(tmp_path):
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


SOUNDS = "file,class,group,start_s,end_s\n"


@pytest.fixture
def sounds(tmp_path):
    """Two sounds, and a copy of the first."""
    for name, content in (("a.wav", b"long"), ("b.wav", b"grit"), ("copy.wav", b"long")):
        (tmp_path / name).write_bytes(content)
    return tmp_path


@pytest.mark.parametrize(
    ("rows", "says"),
    [
        ("a.wav,sand,1,,\na.wav,sand,2,,", "row 3, column file: a.wav is of group '2' here and of '1' in row 2"),
        ("a.wav,sand,1,,\na.wav,clay,1,,", "a.wav is of class 'clay' here and of 'sand' in row 2"),
        ("a.wav,sand,1,,\nb.wav,clay,2,,\ncopy.wav,sand,3,,", "row 4, .*copy.wav, the same as a.wav, is of group '3'"),
        ("a.wav,sand,1,0,3\na.wav,clay,2,3,9\na.wav,clay,2,2.9,4", "row 4, .*of class 'clay' here and of 'sand'"),
        ("a.wav,sand,1,5,\na.wav,clay,2,0,6", "row 2, .*of class 'sand' here and of 'clay' in row 3"),
        ("a.wav,sand,1,0,9\na.wav,sand,1,1,2\na.wav,clay,2,3,4", "of class 'clay' here and of 'sand' in row 2"),
    ],
)
def test_the_same_material_in_two_classes_or_groups_is_named(rows, says, sounds):
    (sounds / "index.csv").write_text(f"{SOUNDS}{rows}\nb.wav,clay,9,,\n")
    with pytest.raises(InputError, match=says):
        read_labelled(sounds)


def test_stretches_may_touch_and_lie_over_each_other_in_one_group(sounds):
    rows = "a.wav,sand,1,0,2\na.wav,sand,1,1,3\na.wav,clay,2,3,4\na.wav,clay,3,4,\n"
    (sounds / "index.csv").write_text(SOUNDS + rows)
    assert len(read_labelled(sounds)) == 4


def test_stretches_do_not_part_a_photograph(folder):
    (folder / "index.csv").write_text(f"{SOUNDS}sand/a.png,sand,1,0,1\nsand/a.png,clay,2,1,2\n")
    with pytest.raises(InputError, match=r"a\.png is of class 'clay' here"):
        read_labelled(folder)


def test_copies_in_one_class_and_group_are_left_out_with_a_note(sounds):
    notes = []
    (sounds / "index.csv").write_text(SOUNDS + "a.wav,sand,1,,\ncopy.wav,sand,1,,\nb.wav,clay,2,,\n")
    assert [item.file.name for item in read_labelled(sounds, notes)] == ["a.wav", "b.wav"]
    assert notes == ["Left out, being copies of others of their class: 1 of 3 labelled files."]


def test_copies_among_sub_folders(folder):
    copy = folder / "sand" / "copy.png"
    copy.write_bytes((folder / "sand" / "a.png").read_bytes())
    notes = []
    assert len(read_labelled(folder, notes)) == 3
    assert "1 of 4 labelled files" in notes[-1]
    copy.rename(folder / "clay" / "copy.png")
    with pytest.raises(InputError, match=r"sand/a\.png: a\.png, the same as copy\.png, is of class 'sand' here and"):
        read_labelled(folder)
    (folder / "clay" / "copy.png").rename(folder / "clay" / "a.png")
    with pytest.raises(InputError, match=r"sand/a\.png: the same file is of class 'sand' here and of 'clay' in clay/a"):
        read_labelled(folder)


def test_a_class_folder_without_a_usable_file_is_named(folder):
    (folder / "rock").mkdir()
    with pytest.raises(InputError, match="rock: no file "):
        read_labelled(folder)
    (folder / "rock" / "day1").mkdir()
    for name in ("x.bmp", "y.BMP", "README"):
        (folder / "rock" / name).write_bytes(b"")
    with pytest.raises(InputError, match=r"passed over: \.bmp \(2\), sub-folder \(1\), without a suffix \(1\)"):
        read_labelled(folder)


def test_unusable_files_among_usable_ones_are_noted(folder):
    notes = []
    read_labelled(folder, notes)
    assert notes == ["Passed over in clay: .txt (1); used: 1."]


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
