"""Choose the temperature and the two priors of `explain` by the probabilities that it gives to what is hidden.

    python tests/studies/judge.py make --set training --cache CACHE
    python tests/studies/judge.py make --set drives --cache CACHE
    python tests/studies/hyperparameters.py --cache CACHE --out evidence.jsonl --processes 2

Each training recording is searched once, and once more without its effect if it has a single one; what was fitted is
kept, so that the posterior can be computed anew for each choice. A recording's score is the sum of the logarithms of
the probabilities of what is true: of each effect, that it is there or that it is not, and of something that the
catalogue lacks likewise [nats]. The table gives the mean over recordings of each generator, with `LEFT_OUT` of the
weight on those searched without their effect, the mean over generators, by which choices are ranked, and how often
effects are right that are stated with some probability.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import os
from collections import Counter
from collections.abc import Iterator, Mapping
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from judging.answers import answer_of

TEMPERATURES, EFFECTS, UNKNOWNS = (
    (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0),
    (0.005, 0.01, 0.02, 0.04, 0.08),
    (0.025, 0.05, 0.1, 0.2),
)
"""What is tried."""

LEFT_OUT = 0.1
"""Weight of recordings whose effect is not in the catalogue: drives are taken to be such ones as often as that."""

LEAST = 1e-3
"""Least probability that counts: a hypothesis that was not fitted has none."""

Evidence = dict[str, Any]
"""Of one search: `name`, `left_out`; `evidence`, for each hypothesis its effects, its log evidence [nats], the
log prior odds of effects that state their own, and the number of the others; `discrepancy`, its log evidence beside
each set of effects."""

Choice = tuple[float, float, float]
"""Temperature, prior probability of an effect, and of something that the catalogue lacks."""


def searched(folder: Path, left_out: str | None) -> Evidence:
    """Search the catalogue, one effect left out if it is stated, for a recording, and give all evidence."""
    from bevameter.identification.explain import explain
    from bevameter.identification.explain.posterior import posterior

    kept: list[Any] = []

    def keeping(found: Any) -> Any:
        kept[:] = found, posterior(found)
        return kept[1]

    with patch.object(explain, "posterior", keeping):
        answer_of(folder, () if left_out is None else (left_out,))
    found, probabilities = kept
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
        "discrepancy": [[sorted(slugs), each.log_evidence] for slugs, each in probabilities.discrepancies.items()],
    }


def probabilities(row: Evidence, choice: Choice) -> tuple[dict[str, float], float]:
    """Give the posterior probability of each effect that was fitted, and of something that the catalogue lacks."""
    temperature, effect, unknown = choice
    odds, weight = math.log(effect / (1.0 - effect)), {}
    for slugs, evidence, stated, count in row["evidence"]:
        key = frozenset(slugs)
        own = evidence / temperature + stated + count * odds
        weight[key] = float(np.logaddexp(weight.get(key, -np.inf), own))
    total = {(key, False): value + math.log(1.0 - unknown) for key, value in weight.items()}
    for slugs, evidence in row["discrepancy"]:
        total[frozenset(slugs), True] = weight[frozenset(slugs)] + evidence / temperature + math.log(unknown)
    whole = np.logaddexp.reduce(list(total.values()))
    effects, lacking = Counter[str](), 0.0
    for (slugs, lacks), value in total.items():
        probability = math.exp(value - whole)
        lacking += lacks * probability
        effects.update(dict.fromkeys(slugs, probability))
    return dict(effects), lacking


def score(row: Evidence, hidden: frozenset[str], choice: Choice) -> float:
    """Sum of the logarithms of the probabilities of what is true [nats]."""
    effects, lacking = probabilities(row, choice)
    true = hidden - {row["left_out"], "beyond"}
    stated = [effects.get(slug, 0.0) if slug in true else 1.0 - effects[slug] for slug in {*effects, *true}]
    stated.append(lacking if lacks(row, hidden) else 1.0 - lacking)
    return float(np.log(np.maximum(stated, LEAST)).sum())


def lacks(row: Evidence, hidden: frozenset[str]) -> bool:
    """Return whether the catalogue that was searched lacks what is hidden."""
    return row["left_out"] is not None or "beyond" in hidden


def jobs(caches: list[Path], hidden: Mapping[str, frozenset[str]]) -> Iterator[tuple[Path, str | None]]:
    """Give what is searched: each recording with the whole catalogue, then without its single effect."""
    for folder in (folder for cache in caches for folder in sorted((cache / "recordings").iterdir())):
        if folder.name in hidden:
            yield folder, None
            if len(hidden[folder.name]) == 1 and "beyond" not in hidden[folder.name]:
                yield folder, *hidden[folder.name]


def line(rows: list[Evidence], hidden: Mapping[str, frozenset[str]], choice: Choice) -> tuple[float, str]:
    """Give the mean score of a choice over generators, and its line of the table."""
    scores: dict[str, dict[bool, list[float]]] = {}
    right = {"likely": Counter[bool](), "sure": Counter[bool]()}
    for row in rows:
        true = hidden[row["name"]]
        of_generator = scores.setdefault(row["name"].split("-")[0], {False: [], True: []})
        of_generator[lacks(row, true)].append(score(row, true, choice))
        if row["left_out"] is None:
            for slug, probability in probabilities(row, choice)[0].items():
                if probability >= 0.85:
                    right["sure" if probability >= 0.95 else "likely"][slug in true] += 1
    means = {
        name: (1.0 - LEFT_OUT) * float(np.mean(each[False])) + LEFT_OUT * float(np.mean(each[True]))
        for name, each in scores.items()
    }
    mean = float(np.mean(list(means.values())))
    said = "  ".join(f"{each[True]} of {each.total()}" for each in right.values())
    each = "  ".join(f"{name} {value:.3f}" for name, value in means.items())
    return mean, "{:11g}  {:9g}  {:10g}".format(*choice) + f"  {mean:7.3f}  ({each})  {said}"


def main() -> None:
    """Search what was not searched yet, and print the table, the best choice first."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cache", type=Path, nargs="+", required=True)
    parser.add_argument("--out", type=Path, required=True, help="JSON lines, added to")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--limit", type=int, help="at most so many searches")
    given = parser.parse_args()
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    rows = [json.loads(line) for line in given.out.read_text().splitlines()] if given.out.is_file() else []
    done = {(row["name"], row["left_out"]) for row in rows}
    truths = [path for cache in given.cache for path in sorted((cache / "truth").glob("*.json"))]
    hidden = {
        path.stem: frozenset(each["effect"] for each in json.loads(path.read_text())["effects"]) for path in truths
    }
    left = [job for job in jobs(given.cache, hidden) if (job[0].name, job[1]) not in done][: given.limit]
    with ProcessPoolExecutor(given.processes) as pool, given.out.open("a", encoding="utf-8") as file:
        for row in pool.map(searched, *zip(*left, strict=True)) if left else ():
            rows.append(row)
            file.write(json.dumps(row) + "\n")
            file.flush()
    print("temperature  P(effect)  P(unknown)     mean  (of each generator)  right from 0.85 to 0.95, and from 0.95")
    table = [line(rows, hidden, choice) for choice in itertools.product(TEMPERATURES, EFFECTS, UNKNOWNS)]
    print("\n".join(text for _, text in sorted(table, reverse=True)))


if __name__ == "__main__":
    main()
