"""The answer in words: what is missing first, how sure that is second, what to do third."""

from __future__ import annotations

from .explanation import Explanation


def summarise(explanation: Explanation) -> str:
    """Give the answer in a few sentences."""
    return explanation.verdict


def trust(explanation: Explanation) -> str:
    """Say what can be relied on: the prediction, the parameters, both or neither."""
    return explanation.verdict
