"""Files of the Rerun viewer, read back by Rerun's own reader."""

from __future__ import annotations

import math
from collections import defaultdict

import numpy as np
import pytest

WITHOUT = "rerun-sdk (the extra rerun) is not installed"


class File:
    """An .rrd file: by entity its rows, each a time [s] (None where it holds at all times) and components by name."""

    def __init__(self, path):
        reader = pytest.importorskip("rerun.chunk", reason=WITHOUT).RrdReader(str(path))
        self.views = [
            batch.column("ViewBlueprint:space_origin")[0].as_py()[0]
            for views in reader.blueprints()
            for batch in (chunk.to_record_batch() for chunk in reader.stream(store=views))
            if "ViewBlueprint:space_origin" in batch.schema.names
        ]
        self.rows = defaultdict(list)
        self.timelines = set()
        for chunk in reader.stream():
            batch, self.timelines = chunk.to_record_batch(), self.timelines | set(chunk.timeline_names)
            names = [name for name in batch.schema.names if ":" in name]
            times = [None] * len(batch)
            if "recording" in batch.schema.names:
                times = (np.array(batch.column("recording").cast("int64")) / 1e9).tolist()
            values = {name.split(":")[1]: batch.column(name).to_pylist() for name in names}
            for row, time in enumerate(times):
                self.rows[chunk.entity_path].append((time, {name: each[row] for name, each in values.items()}))
            if "utc" in batch.schema.names:
                self.utc = batch.column("utc")[0].as_py(), times[0]

    def series(self, entity):
        """Times [s] and values, NaN where a row is empty."""
        rows = sorted(self.rows[entity], key=lambda row: row[0])
        return [t for t, _ in rows], [each["scalars"][0] if each["scalars"] else math.nan for _, each in rows]

    def one(self, entity, component):
        """Of an entity that was written once."""
        (found,) = [each[component] for _, each in self.rows[entity] if component in each]
        return found
