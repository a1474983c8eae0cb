"""A drive on a known soil, simulated by code that shares nothing with the simulator that is fitted."""

import pytest
from bevameter.framework.core.recording.types import WheelTable
from bevameter.framework.core.vehicle import Vehicle, Wheel
from bevameter.identification.explain.fit import fit_textbook
from bevameter.identification.explain.samples import gather
from concealed.conceal import conceal


@pytest.fixture(scope="session")
def null():
    """A recording in which nothing is hidden."""
    return conceal(41, (), "hidden", "field", samples=300)


@pytest.fixture(scope="session")
def fitted(null):
    """Its samples with the textbook wheel fitted."""
    return fitted_to(null)


def fitted_to(recording):
    """Problem and textbook fit of a concealed recording."""
    stated = recording.vehicle
    wheel = Wheel(**{key: stated[key] for key in ("radius_m", "width_m", "grouser_height_m", "grouser_count")})
    table = WheelTable(recording.recorded.columns, None, recording.recorded.run, "test")
    return fit_textbook(gather(table, wheel, Vehicle(name="test", wheels=(wheel,), noise=stated["noise"])))
