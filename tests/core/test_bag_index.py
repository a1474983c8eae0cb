"""What a bag holds by its index, and the look at a part of a large one."""

from __future__ import annotations

from collections import Counter

import pytest
from bevameter.framework.core.errors import InputError
from bevameter.framework.core.recording import bag_index
from bevameter.framework.core.recording.bag_files import BagFile
from bevameter.framework.core.recording.bag_index import BagExcerpt, index_of
from every_bag import KINDS, SECONDS, START_NS, write_bag


def counted(bag):
    """What reading every message gives."""
    messages = list(bag.messages())
    times = {}
    for each in messages:
        times.setdefault(each.topic.name, []).append(each.time_ns)
    return {name: (len(each), min(each), max(each)) for name, each in times.items()}


@pytest.mark.parametrize("kind", KINDS)
def test_the_index_is_what_reading_gives(kind, tmp_path, rng):
    _, path = write_bag(kind, tmp_path, rng)
    found = {name: (each.n_messages, each.first_ns, each.last_ns) for name, each in index_of(BagFile(path)).items()}
    assert found == counted(BagFile(path))
    assert found["/wheel/joints"] == (SECONDS * 50, START_NS, START_NS + (SECONDS * 50 - 1) * 20_000_000)


@pytest.mark.parametrize("kind", ["ros1_lz4", "ros2_sqlite", "ros2_mcap", "mcap"])
def test_of_these_the_index_is_read_and_no_message(kind, tmp_path, rng, monkeypatch):
    _, path = write_bag(kind, tmp_path, rng)
    monkeypatch.setattr(bag_index, "_by_reading", lambda messages: pytest.fail("messages were read"))
    assert len(index_of(BagFile(path))) == 7


@pytest.mark.parametrize("kind", KINDS)
def test_of_a_large_bag_the_middle_is_read_and_what_is_rare(kind, tmp_path, rng):
    _, path = write_bag(kind, tmp_path, rng)
    size = sum(file.stat().st_size for file in BagFile(path).files)
    bag = BagExcerpt(path, most_bytes=size // 4)
    messages = list(bag.messages())
    joints = [each.time_ns for each in messages if each.topic.name == "/wheel/joints"]
    assert 0.2 * SECONDS * 50 <= len(joints) <= 0.3 * SECONDS * 50
    assert abs((joints[0] + joints[-1]) / 2 - (START_NS + SECONDS / 2 * 1e9)) < 5e7
    assert Counter(each.topic.name for each in messages)["/audio_info"] == 1  # at the beginning
    assert bag.first_messages().keys() == bag.index.keys()
    assert {each.topic.name for each in bag.messages({"/odom"})} == {"/odom"}


def test_a_cut_bag_is_counted_as_far_as_it_goes(tmp_path, rng):
    _, path = write_bag("mcap", tmp_path, rng)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    bag = BagExcerpt(path)
    assert 0 < bag.index["/wheel/joints"].n_messages < SECONDS * 50
    assert "cut off or damaged" in bag.problems[0]


def test_what_is_no_bag_is_refused(tmp_path):
    path = tmp_path / "drive.mcap"
    path.write_bytes(b"not a bag at all")
    with pytest.raises(InputError, match="expected a ROS 1 bag"):
        BagExcerpt(path)
