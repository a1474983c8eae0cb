"""What the tests of sound share: the generator of its study, which is no part of the package."""

from __future__ import annotations

import pytest
import sound_mismatch


@pytest.fixture(scope="session")
def study():
    return sound_mismatch
