"""Choose the temperature and the two priors of `explain` by the probability that it gives to the hidden effects.

    python tests/studies/judge.py make --set training --cache CACHE
    python tests/studies/hyperparameters.py --cache CACHE --out evidence.jsonl --processes 2

Each training recording is searched once, and once more without its effect if it has a single one; what was fitted is
kept, so that the posterior can be computed anew for each choice. The table gives the mean of ln P(what is hidden) with
the whole catalogue, of ln P(something that the catalogue lacks) without the effect, and of both, the latter with a
weight of `LEFT_OUT` [nats]; and how often effects are right that are stated with some probability. The largest mean of
both wins.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import os
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

TEMPERATURES, EFFECTS, UNKNOWNS = (
    (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0),
    (0.0025, 0.005, 0.01, 0.02, 0.04),
    (0.025, 0.05, 0.1, 0.2),
)
"""What is tried."""

LEFT_OUT = 0.1
"""Weight of recordings whose effect is not in the catalogue: drives are taken to be such ones as often as that."""

LEAST = math.log(1e-6)
"""What a hypothesis that was not fitted scores [nats]."""


def searched(folder: Path, left_out: str | None) -> dict[str, Any]:
    """Search the catalogue, one effect left out if it is stated, for a recording, and give all evidence."""
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
    found = search(problem, textbook, [slug for slug in SLUGS if slug != left_out])
    return {
        "name": folder.name,
        "left_out": left_out,
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
        "discrepancy": [[sorted(slugs), each.log_evidence] for slugs, each in posterior(found).discrepancies.items()],
    }


def log_posterior(
    row: dict[str, Any], temperature: float, effect: float, unknown: float
) -> dict[tuple[frozenset[str], bool], float]:
    """Give the log-posterior of each set of effects, without and with a discrepancy."""
    odds, weight = math.log(effect / (1.0 - effect)), {}
    for slugs, evidence, stated, count in row["evidence"]:
        key = frozenset(slugs)
        own = evidence / temperature + stated + count * odds
        weight[key] = float(np.logaddexp(weight.get(key, -np.inf), own))
    total = {(key, False): value + math.log(1.0 - unknown) for key, value in weight.items()}
    for slugs, evidence in row["discrepancy"]:
        total[frozenset(slugs), True] = weight[frozenset(slugs)] + evidence / temperature + math.log(unknown)
    whole = np.logaddexp.reduce(list(total.values()))
    return {key: float(value - whole) for key, value in total.items()}


def jobs(cache: Path, truths: dict[str, Any]) -> Iterator[tuple[Path, str | None]]:
    """Give what is searched: each recording with the whole catalogue, then without its single effect."""
    for name, truth in truths.items():
        yield cache / "recordings" / name, None
        if len(truth["effects"]) == 1:
            yield cache / "recordings" / name, truth["effects"][0]["effect"]


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
    done = {(row["name"], row["left_out"]) for row in rows}
    truths = {path.stem: json.loads(path.read_text()) for path in sorted((given.cache / "truth").glob("*.json"))}
    left = [job for job in jobs(given.cache, truths) if (job[0].name, job[1]) not in done][: given.limit]
    with ProcessPoolExecutor(given.processes) as pool, given.out.open("a", encoding="utf-8") as file:
        for row in pool.map(searched, *zip(*left, strict=True)) if left else ():
            rows.append(row)
            file.write(json.dumps(row) + "\n")
            file.flush()
    print("temperature  P(effect)  P(unknown)  ln P(hidden)  left out  both  right from 0.85 to 0.95, and from 0.95")
    for choice in itertools.product(TEMPERATURES, EFFECTS, UNKNOWNS):
        scores, right = {True: [], False: []}, {name: Counter() for name in ("likely", "sure")}
        for row in rows:
            hidden = frozenset(each["effect"] for each in truths[row["name"]]["effects"])
            found = log_posterior(row, *choice)
            if row["left_out"]:
                unknown = np.logaddexp.reduce([value for (_, lacks), value in found.items() if lacks])
                scores[True].append(max(unknown, LEAST))
                continue
            scores[False].append(max(found.get((hidden, False), LEAST), LEAST))
            for slug in {slug for slugs, _ in found for slug in slugs}:
                share = sum(math.exp(value) for (slugs, _), value in found.items() if slug in slugs)
                if share >= 0.85:
                    right["sure" if share >= 0.95 else "likely"][slug in hidden] += 1
        known, lacking = np.mean(scores[False]), np.mean(scores[True])
        both = (1.0 - LEFT_OUT) * known + LEFT_OUT * lacking
        said = "  ".join(f"{each[True]} of {each.total()}" for each in right.values())
        print("{:11g}  {:9g}  {:10g}".format(*choice), f" {known:12.3f}  {lacking:8.3f}  {both:.3f}  {said}")


if __name__ == "__main__":
    main()
