"""ROS 1 bags, ROS 2 bags and MCAP files."""

from __future__ import annotations

from pathlib import Path

from ...vehicle import Vehicle
from ..contents import Contents
from ..readers import Reader, register, vehicle_near
from ..types import Recording


@register
class BagReader(Reader):
    """Reads bags; their libraries are imported when the first one is read."""

    kinds = "a ROS bag (.bag or a ROS 2 folder) or .mcap"
    takes_topics = True

    def sniff(self, path: Path) -> bool:
        """Recognise a bag by its ending, and a ROS 2 bag's folder by its metadata or its storage files."""
        if path.is_dir():
            return (path / "metadata.yaml").is_file() or any(path.glob("*.db3")) or any(path.glob("*.mcap"))
        return path.suffix.lower() in (".bag", ".mcap", ".db3")

    def read(self, path: Path, *, vehicle: Vehicle | None, topics: Path | None) -> Recording:
        """Read the streams that the topic map names, or that names and types of topics identify."""
        from ..bags import read_bag

        return read_bag(path, vehicle=vehicle or vehicle_near(path), topics=topics)

    def inspect(self, path: Path, *, vehicle: Vehicle | None, topics: Path | None) -> Contents:
        """Say what is in it by its index, and what is read from each topic."""
        from ..bag_contents import inspect_bag

        return inspect_bag(path, vehicle=vehicle or vehicle_near(path), topics=topics)
