"""Exports in every format: one door, and the registry of the exporters behind it.

A format is one module with one exporter. Those in `formats` are found there; one of another distribution is found by
its entry point in the group ``bevameter.exporters``, or registers itself when its module is imported::

    @register
    class AsciiGrid(Exporter):
        name = "asc"
        endings = (".asc",)
        holds = "one layer as an Esri ASCII grid"

        def write(self, request, out):
            grid = request.grid()
            ...
"""

from __future__ import annotations

import pkgutil
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from ..framework.core.arguments import path_of, shown
from ..framework.core.errors import InputError
from ..framework.core.files import check_outputs
from ..framework.core.plugins import load_plugins, once
from .grid import LAYERS, Grid
from .snapshot import DEFAULT_NORMAL_STRESS, Snapshot

if TYPE_CHECKING:
    from .georeference import Origin

SETTINGS = {
    "bounds": ("bounds", "x0, y0, x1, y1 [m]"),
    "resolution": ("resolution", "the edge of a raster's cell [m]"),
    "layers": ("layers", "names of layers"),
    "required_strength_Pa": ("required strength", "the shear strength that the vehicle needs [Pa]"),
    "origin": ("origin", "latitude and longitude of the site's x = y = 0 [deg]"),
    "wheel_width_m": ("wheel width", "the width of the wheels that measured the soil [m]"),
    "elastic_stiffness_Pa_m": ("elastic stiffness", "how stiff the soil is when it is unloaded [Pa/m]"),
    "damping_Pa_s_m": ("damping", "the soil's damping [Pa s/m]"),
}
"""Settings that a format may have, or need: their names in text, and what is expected."""

RASTER = ("bounds", "resolution", "layers")
"""Settings of formats that hold a raster of any layers."""


@dataclass(frozen=True)
class Request:
    """What is to be exported. Settings are None where nobody stated them.

    Parameters
    ----------
    view
        What is known of the site.
    bounds
        x0, y0, x1, y1 [m]; all ground that was seen where absent.
    resolution
        Edge of a raster's cell [m]; that of the database's cells where absent.
    layers
        Names among `grid.LAYERS`; all where absent.
    normal_stress, confidence
        At which strengths are wanted [Pa], [-].
    required_strength_Pa
        Shear strength that the vehicle needs [Pa].
    origin
        Where on Earth the site's frame lies; as the database has it where absent.
    wheel_width_m
        Width of the wheels that measured the soil [m].
    elastic_stiffness_Pa_m, damping_Pa_s_m
        Of the soil under a wheel, which wheels do not measure [Pa/m], [Pa s/m].
    """

    view: Snapshot
    bounds: Sequence[float] | None = None
    resolution: float | None = None
    layers: Sequence[str] | None = None
    normal_stress: float = DEFAULT_NORMAL_STRESS
    confidence: float = 0.95
    required_strength_Pa: float | None = None
    origin: Origin | None = None
    wheel_width_m: float | None = None
    elastic_stiffness_Pa_m: float | None = None
    damping_Pa_s_m: float | None = None

    def grid(self, layers: Sequence[str] | None = None) -> Grid:
        """Sample the region; `layers` are those that the format needs, or else those that were requested."""
        bounds = self.view.extent if self.bounds is None else self.bounds
        resolution = self.view.cell_size_m if self.resolution is None else self.resolution
        chosen = layers or self.layers or LAYERS
        return self.view.grid(bounds, resolution, chosen, normal_stress=self.normal_stress, confidence=self.confidence)

    def stated(self, name: str) -> Any:
        """Give a setting that the format needs; raises `InputError` where nobody stated it."""
        value = self.view.origin if name == "origin" and self.origin is None else getattr(self, name)
        if value is None:
            label, meaning = SETTINGS[name]
            raise InputError(label, "not stated", expected=meaning)
        return value


class Exporter(ABC):
    """Writes one format.

    Attributes
    ----------
    name
        That it is requested by.
    endings
        Of its files, with the dot; an empty one is that of a folder.
    holds
        What its files hold, in words.
    settings
        Of a `Request`, those that mean anything to it, beside the view, the normal stress and the confidence.
    """

    name: ClassVar[str]
    endings: ClassVar[tuple[str, ...]]
    holds: ClassVar[str]
    settings: ClassVar[tuple[str, ...]] = RASTER

    def files(self, out: Path) -> tuple[Path, ...]:
        """Name the files that will be written."""
        return (out,)

    @abstractmethod
    def write(self, request: Request, out: Path) -> None:
        """Write the files, whole or not at all; raises `InputError` where the request lacks or mistakes something."""


EXPORTERS: list[Exporter] = []


def register(exporter: type[Exporter]) -> type[Exporter]:
    """Add an exporter, as a decorator of its class; one that was added later is tried earlier."""
    EXPORTERS.insert(0, exporter())
    return exporter


@once
def load_exporters() -> None:
    """Import the modules of this package's formats, and of others that entry points name."""
    from . import formats

    others = list(EXPORTERS)
    for module in pkgutil.iter_modules(formats.__path__):
        import_module(f"{formats.__name__}.{module.name}")
    load_plugins("bevameter.exporters")
    EXPORTERS.sort(key=others.__contains__, reverse=True)  # what was registered before comes before


def export(request: Request, out: str | Path, name: str | None = None) -> tuple[Path, ...]:
    """Write what is known into a file that another program reads.

    Parameters
    ----------
    request
        What is to be exported.
    out
        The file; a folder for a ROS 2 bag.
    name
        Of the format; by the file's ending where absent.

    Returns
    -------
    tuple of Path
        What was written.

    Raises
    ------
    InputError
        No such format, a file that cannot be written, a setting that the format lacks, mistakes or has no use for.
    """
    out = path_of("out", out, "the path of a file to write")
    exporter = _exporter(out, name)
    for field in fields(Request):
        used = field.name in ("view", "normal_stress", "confidence", *exporter.settings)
        if not used and getattr(request, field.name) is not None:
            meaningful = ", ".join(SETTINGS[name][0] for name in exporter.settings)
            raise InputError(SETTINGS[field.name][0], f"means nothing to {exporter.name}", expected=meaningful)
    files = exporter.files(out)
    check_outputs(files, [])
    exporter.write(request, out)
    return files


def _exporter(out: Path, name: str | None) -> Exporter:
    load_exporters()
    ending = out.suffix.lower()
    if name is None:
        found = [exporter for exporter in EXPORTERS if ending and ending in exporter.endings]
        if not found:
            raise InputError(out, f"a file of kind {ending!r}", expected=_kinds())
        return found[0]
    found = [exporter for exporter in EXPORTERS if exporter.name == name]
    if not found:
        raise InputError("format", shown(name), expected=" or ".join(exporter.name for exporter in EXPORTERS))
    if ending not in found[0].endings:
        endings = " or ".join(each or "no ending, a folder" for each in found[0].endings)
        raise InputError(out, f"a file of kind {ending!r} for {name}", expected=endings)
    return found[0]


def _kinds() -> str:
    return ", ".join(f"{ending} ({exporter.name})" for exporter in EXPORTERS for ending in exporter.endings if ending)
