"""A wheel file or a vibration file on its own."""

from __future__ import annotations

from pathlib import Path

from ...track.way import pose_from_wheel
from ...vehicle import Vehicle
from ..contents import Contents
from ..digest import StreamDigest
from ..readers import Reader, register, vehicle_near
from ..sheet import ENDINGS
from ..table_contents import inspect_table
from ..tables import column_names, is_table, read_table
from ..types import Recording
from ..vibration import read_vibration_run
from ..wheel_columns import is_wheel_channel
from ..wheel_file import derive_all, read_wheel


@register
class SingleFileReader(Reader):
    """Reads a table: a vibration file has time and no wheel channel, any other is a wheel file."""

    kinds = "a wheel file (.csv, .csv.gz, .tsv, .txt, .parquet, .xlsx)"
    takes_topics = True

    def sniff(self, path: Path) -> bool:
        """Recognise a table by its ending."""
        return path.name.lower().endswith(ENDINGS) and not path.is_dir()

    def read(self, path: Path, *, vehicle: Vehicle | None, topics: Path | None) -> Recording:
        """Read the file, its columns by the column map `topics` where there is one; the wheel drives of ``imu….csv``
        are those of ``pro….csv``.
        """
        digest, name = StreamDigest(), path.name.split(".")[0]
        if topics is None and _is_vibration(path):
            drives = path.with_name(path.name.replace("imu", "pro", 1))
            paired = path.name.startswith("imu") and drives.is_file()
            run = read_vibration_run(path, drives if paired else None)
            digest.add_vibration(run)
            return Recording(name, path, vehicle, None, "", digest.hexdigest(), problems=run.problems, vibration=run)
        vehicle = vehicle or vehicle_near(path)
        table, problems, notes = read_wheel(path, topics)
        digest.add_wheel(table)
        if vehicle is not None:
            table = derive_all(table, vehicle)
        pose, found = pose_from_wheel(table, vehicle)
        return Recording(
            name, path, vehicle, None, "", digest.hexdigest(), wheel=table, pose=pose, problems=problems + found,
            notes=notes,
        )  # fmt: skip

    def inspect(self, path: Path, *, vehicle: Vehicle | None, topics: Path | None) -> Contents:
        """Say what its columns are; of a vibration file which stream it is."""
        if topics is None and _is_vibration(path):
            return super().inspect(path, vehicle=vehicle, topics=topics)
        vehicle = vehicle or vehicle_near(path)
        return inspect_table(path, lambda: self.read(path, vehicle=vehicle, topics=topics), vehicle, topics)


def _is_vibration(path: Path) -> bool:
    """Recognise a vibration file by its time without a wheel channel, a misspelt one included."""
    if not is_table(path):
        return False
    names = set(column_names(path))
    channels = names - {"time", "time_s"}
    if channels == names or any(map(is_wheel_channel, channels)):
        return False
    return len(read_table(path).numbers) > 1
