"""All cells of a site as a file: Parquet, CSV or GeoJSON, with the belief over classes and the soil of each."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...framework.core.arguments import path_of
from ...framework.core.errors import InputError
from ...framework.core.files import whole, write_csv, write_text
from ...framework.core.pooling import cells_from_keys
from ..exporters import Exporter, Request, register
from ..exports import SCHEMA, answer_rows, csv_columns, flat, geojson
from ..snapshot import DEFAULT_NORMAL_STRESS, Snapshot

_TEXTS = ("unknown", "class", "note")


def write_cells(
    snapshot: Snapshot,
    file: str | Path,
    *,
    normal_stress: float = DEFAULT_NORMAL_STRESS,
    confidence: float = 0.95,
    now: float | None = None,
) -> int:
    """Write all cells that somebody has seen, in order of x and y, and give their number; unknown is null.

    Parameters
    ----------
    snapshot
        Of the site.
    file
        Its ending decides on the format: `.parquet`, `.csv` or `.geojson`. Columns of the first two are those of
        ``bevameter query near --format csv``; GeoJSON has squares in the site's own frame, metres.
    normal_stress, confidence, now
        As in `Snapshot.along`.

    Raises
    ------
    InputError
        Another ending, a stress or a confidence out of range, or the file cannot be written.
    """
    target = path_of("file", file, "the path of a file")
    write = _WRITERS.get(target.suffix.lower())
    if write is None:
        raise InputError(target, f"ends in {target.suffix!r}", expected=" or ".join(_WRITERS))
    moment = time.time() if now is None else now
    centres = (cells_from_keys(snapshot.cells.key) + 0.5) * snapshot.cell_size_m
    answer = snapshot.along(centres, normal_stress=normal_stress, confidence=confidence, now=moment)
    rows = answer_rows(answer)
    about = {
        "schema": SCHEMA, "site": snapshot.site, "cell_size_m": snapshot.cell_size_m, "confidence": answer.confidence,
        "normal_stress_Pa": answer.normal_stress, "ages_refer_to_s": moment,
    }  # fmt: skip
    write(rows, snapshot, about, target)
    return len(rows)


class _Cells(Exporter):
    """All cells that somebody has seen, a row each."""

    settings = ()

    def write(self, request: Request, out: Path) -> None:
        """Write `write_cells`."""
        write_cells(request.view, out, normal_stress=request.normal_stress, confidence=request.confidence)


@register
class Parquet(_Cells):
    """For data frames."""

    name = "parquet"
    endings = (".parquet",)
    holds = "all cells of the site, a row each, as Parquet"


@register
class Csv(_Cells):
    """For spreadsheets."""

    name = "csv"
    endings = (".csv",)
    holds = "all cells of the site, a row each, as CSV"


@register
class GeoJson(_Cells):
    """Squares in the site's own frame."""

    name = "geojson"
    endings = (".geojson",)
    holds = "all cells of the site as GeoJSON, in the site's own frame"


def _write_parquet(rows: Sequence[dict[str, Any]], view: Snapshot, about: dict[str, Any], file: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    kinds = {"known": pa.bool_(), "observations": pa.int64()} | dict.fromkeys(_TEXTS, pa.string())
    fields = [pa.field(name, kinds.get(name, pa.float64())) for name in csv_columns(view.class_names)]
    schema = pa.schema(fields, metadata={"bevameter": json.dumps(about)})
    table = pa.Table.from_pylist([flat(row) for row in rows], schema=schema)
    with whole(file) as part:
        parquet.write_table(table, part, compression="zstd")


def _write_csv(rows: Sequence[dict[str, Any]], view: Snapshot, about: dict[str, Any], file: Path) -> None:
    with whole(file) as part, part.open("w", encoding="utf-8", newline="") as stream:
        write_csv([flat(row) for row in rows], csv_columns(view.class_names), stream)


def _write_geojson(rows: Sequence[dict[str, Any]], view: Snapshot, about: dict[str, Any], file: Path) -> None:
    page = geojson(rows, view, view.cell_size_m)
    write_text(json.dumps(page, ensure_ascii=False, allow_nan=False) + "\n", file)


_WRITERS = {".parquet": _write_parquet, ".csv": _write_csv, ".geojson": _write_geojson}
