"""A search that found one effect, which several modules look at."""

from __future__ import annotations

import pytest
from bevameter.identification.effects.catalogue import effects_for
from bevameter.identification.felt_rows import felt_rows
from bevameter.identification.identify import open_recording
from bevameter.identification.mismatch.fit.samples import gather
from bevameter.identification.mismatch.fit.trial import (
    situation,
    textbook_trial,
    try_adding,
)
from bevameter.identification.mismatch.name.tries import Search
from concealed.conceal import conceal


@pytest.fixture(scope="module")
def searched(tmp_path_factory):
    folder = conceal(7110, ("slip_sinkage",), "plain", protocol="steady").write(
        tmp_path_factory.mktemp("made") / "sinks"
    )
    rows = felt_rows(open_recording(folder, None))
    problem, textbook = textbook_trial(gather(rows.table, rows.wheel, rows.vehicle))
    effect = next(iter(effects_for(situation(problem, textbook.fitted), ["slip_sinkage"])))
    trial = try_adding(problem, textbook, textbook, effect)
    return problem, Search(textbook, (trial,), (), trial)


@pytest.fixture
def trials(tmp_path):
    """What a concealed recording gives to search: its problem, the textbook's trial, and forms of effects by name."""

    def make(seed: int, hidden: tuple[str, ...], level: str, protocol: str):
        opened = open_recording(conceal(seed, hidden, level, protocol).write(tmp_path), None)
        rows = felt_rows(opened)
        problem, textbook = textbook_trial(gather(rows.table, rows.wheel, rows.vehicle))

        def forms(*slugs: str):
            return {effect.name: effect for effect in effects_for(situation(problem, textbook.fitted), slugs)}

        return problem, textbook, forms

    return make
