"""The registry of exporters: a format from outside the package is one class that registers itself."""

import numpy as np
import pytest
from bevameter import InputError
from bevameter.database import exporters
from bevameter.database.exporters import Exporter, Request, export
from bevameter.database.snapshot import Snapshot


@pytest.fixture
def view(drive_with_soil) -> Snapshot:
    return Snapshot.derive("quarry", [drive_with_soil])


@pytest.fixture
def own():
    """A format of somebody else's, registered for one test."""
    exporters.load_exporters()
    before = list(exporters.EXPORTERS)

    @exporters.register
    class Text(Exporter):
        name = "text"
        endings = (".txt",)
        holds = "one layer as text"

        def write(self, request, out):
            grid = request.grid()
            np.savetxt(out, grid.layers[next(iter(grid.layers))])

    yield Text
    exporters.EXPORTERS[:] = before


def test_a_format_of_ones_own(view, own, tmp_path):
    request = Request(view, layers=["observation_count"])
    assert export(request, tmp_path / "counts.txt") == (tmp_path / "counts.txt",)
    counts = np.loadtxt(tmp_path / "counts.txt")
    assert counts.shape == (3, 6), "all ground that was seen, at the size of the database's cells"
    assert counts.sum() == 3
    export(Request(view, layers=["known"], bounds=(0, 0, 1, 1), resolution=0.1), tmp_path / "a.TXT", "text")
    assert np.loadtxt(tmp_path / "a.TXT").shape == (10, 10)


def test_every_format_has_a_name_and_an_ending_of_its_own():
    exporters.load_exporters()
    names = [exporter.name for exporter in exporters.EXPORTERS]
    endings = [ending for exporter in exporters.EXPORTERS for ending in exporter.endings]
    assert len(set(names)) == len(names)
    assert len(set(endings)) == len(endings)
    for exporter in exporters.EXPORTERS:
        assert set(exporter.settings) <= set(exporters.SETTINGS)


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda view, out: export(Request(view), out / "a.xyz"), r"a\.xyz: a file of kind '\.xyz' .*\.yaml \(nav2\)"),
        (lambda view, out: export(Request(view), out / "a"), "a file of kind ''"),
        (lambda view, out: export(Request(view), out / "a.yaml", "nav3"), "format: 'nav3' .expected .*nav2"),
        (lambda view, out: export(Request(view), out / "a.txt", "nav2"), r"kind '\.txt' for nav2 .expected \.yaml"),
        (lambda view, out: export(Request(view), 3), "out: 3"),
        (
            lambda view, out: export(Request(view, wheel_width_m=0.1), out / "a.yaml"),
            "wheel width: means nothing to nav2 .expected bounds, resolution, required strength",
        ),
        (lambda view, out: export(Request(view), out / "none" / "a.yaml"), "there is no folder"),
        (
            lambda view, out: export(Request(Snapshot.derive("", []), required_strength_Pa=1.0), out / "a.yaml"),
            "site: '' .expected ground that somebody has seen",
        ),
    ],
)
def test_what_cannot_be_exported_is_one_clear_error(view, tmp_path, ask, said):
    with pytest.raises(InputError, match=said):
        ask(view, tmp_path)
    assert not list(tmp_path.iterdir())
