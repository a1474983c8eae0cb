"""Choose the temperature and the two priors of `explain`: by the probability that it gives to what is hidden.

    python tests/studies/judge.py make --set training --cache CACHE
    python tests/studies/hyperparameters.py --cache CACHE --out evidence.jsonl --processes 2

Each training recording is searched once; what was fitted is kept, so that the posterior can be weighed anew for each
choice. The table gives the mean of ln P(what is hidden) [nats], and how often P is calibrated; the largest mean wins.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import os
from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

TEMPERATURES, EFFECTS, UNKNOWNS = (
    (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0),
    (0.0025, 0.005, 0.01, 0.02, 0.04),
    (0.02, 0.05, 0.1),
)
"""What is tried."""


def searched(folder: Path) -> dict[str, Any]:
    """Search the catalogue for a recording, and give all evidence."""
    from bevameter.framework.core.soil import as_knowledge
    from bevameter.identification.effects.catalogue import SLUGS
    from bevameter.identification.estimate.identify import open_recording
    from bevameter.identification.explain.fit import fit_textbook
    from bevameter.identification.explain.posterior import posterior
    from bevameter.identification.explain.samples import gather
    from bevameter.identification.explain.search import search
    from bevameter.identification.rows.select import select_wheel_rows

    rows = select_wheel_rows(open_recording(folder, None))
    soil = folder / "soil.toml"
    problem, textbook = fit_textbook(
        gather(rows.table, rows.wheel, rows.vehicle), as_knowledge(soil if soil.is_file() else None)
    )
    found = search(problem, textbook, SLUGS)
    beside = posterior(found).discrepancies
    return {
        "name": folder.name,
        "evidence": [
            # At a prior probability of a half the odds of effects that do not state their own are nothing.
            [
                sorted(each.slugs),
                each.log_evidence,
                found.log_prior(each, 0.5),
                sum(one.prior_probability is None for one in each.effects),
            ]
            for each in found.hypotheses
        ],
        "discrepancy": [[sorted(slugs), each.log_evidence] for slugs, each in beside.items()],
    }


def weighed(row: dict[str, Any], temperature: float, effect: float, unknown: float) -> dict[frozenset[str], float]:
    """Give the posterior of each set of effects, discrepancies summed out."""
    odds, weight = math.log(effect / (1.0 - effect)), {}
    for slugs, evidence, stated, count in row["evidence"]:
        key = frozenset(slugs)
        own = evidence / temperature + stated + count * odds
        weight[key] = float(np.logaddexp(weight.get(key, -np.inf), own))
    beside = {frozenset(slugs): evidence for slugs, evidence in row["discrepancy"]}
    total = {
        key: np.logaddexp(
            value + math.log(1.0 - unknown), value + beside.get(key, -np.inf) / temperature + math.log(unknown)
        )
        for key, value in weight.items()
    }
    whole = np.logaddexp.reduce(list(total.values()))
    return {key: float(np.exp(value - whole)) for key, value in total.items()}


def main() -> None:
    """Search what was not searched yet, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True, help="JSON lines, added to")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--limit", type=int, help="at most so many recordings")
    given = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    rows = [json.loads(line) for line in given.out.read_text().splitlines()] if given.out.is_file() else []
    done = {row["name"] for row in rows}
    folders = [each for each in sorted((given.cache / "recordings").iterdir()) if each.name not in done][: given.limit]
    with ProcessPoolExecutor(given.processes) as pool, given.out.open("a", encoding="utf-8") as file:
        for row in pool.map(searched, folders):
            rows.append(row)
            file.write(json.dumps(row) + "\n")
            file.flush()
    truths = {row["name"]: json.loads((given.cache / "truth" / f"{row['name']}.json").read_text()) for row in rows}
    print("temperature  P(effect)  P(unknown)  mean ln P(hidden)  right of those from 0.85 to 0.95, and from 0.95")
    for temperature, effect, unknown in itertools.product(TEMPERATURES, EFFECTS, UNKNOWNS):
        scores, right = [], {name: Counter() for name in ("likely", "sure")}
        for row in rows:
            hidden = frozenset(each["effect"] for each in truths[row["name"]]["effects"])
            sets = weighed(row, temperature, effect, unknown)
            # What was not fitted has next to no probability.
            scores.append(math.log(max(sets.get(hidden, 0.0), 1e-6)))
            for slug in set().union(*sets):
                share = sum(value for key, value in sets.items() if slug in key)
                if share >= 0.85:
                    right["sure" if share >= 0.95 else "likely"][slug in hidden] += 1
        said = "  ".join(f"{each[True]} of {each.total()}" for each in right.values())
        print(f"{temperature:11g}  {effect:9g}  {unknown:10g}  {np.mean(scores):17.3f}  {said}")


if __name__ == "__main__":
    main()
