"""Findings: what a reader of a result has to know, as data that is put into words at the edge."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

Severity = Literal["note", "warning"]
"""``"note"``: what was done with the data. ``"warning"``: the data or the model are in doubt."""


Values = Mapping[str, Any]

Sentence = str | Callable[[Values], str]
"""A template for `str.format`, or a function of the values."""


@dataclass(frozen=True)
class Finding:
    """Something found about data or a result.

    Parameters
    ----------
    code
        Stable name of the kind of finding, to be tested for by programs.
    severity
        ``"note"`` or ``"warning"``.
    values
        Numbers, in SI units, and names that its sentence mentions; `None` where one is not known.
    """

    code: str
    severity: Severity = "note"
    values: Values = field(default_factory=dict)

    def with_values(self, **values: Any) -> Finding:
        """Give the same finding with further values."""
        return Finding(self.code, self.severity, {**self.values, **values})

    def to_json(self) -> dict[str, Any]:
        """Lay out for JSON."""
        return {"code": self.code, "severity": self.severity, "values": dict(self.values)}


def note(code: str, **values: Any) -> Finding:
    """Make a note."""
    return Finding(code, "note", values)


def warning(code: str, **values: Any) -> Finding:
    """Make a warning."""
    return Finding(code, "warning", values)


def codes(findings: Iterable[Finding]) -> list[str]:
    """List the codes of findings."""
    return [finding.code for finding in findings]


def in_words(finding: Finding, sentences: Mapping[str, Sentence]) -> str:
    """Put a finding into the words of a table of sentences by code; it begins with the wheel that it is of, if any."""
    sentence, values = sentences[finding.code], finding.values
    if not isinstance(sentence, str):
        text = sentence(values)
    else:
        listed = {name: ", ".join(value) if isinstance(value, list) else value for name, value in values.items()}
        text = sentence.format(**listed)
    return f"{values['of_wheel']}: {text}" if "of_wheel" in values else text
