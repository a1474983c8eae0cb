"""Evidence as the rows that `bevameter classify` gives."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..framework.core.evidence import ClassEvidence


def evidence_rows(file: Path, start_s: np.ndarray, end_s: np.ndarray, evidence: ClassEvidence) -> list[dict]:
    """Write the evidence of n windows from `start_s` to `end_s` (n,) [s] of a file as n rows (CONTRACTS: classify)."""
    return [
        {
            "file": str(file),
            "start_s": round(float(start_s[i]), 6),
            "end_s": round(float(end_s[i]), 6),
            "class": name,
            "probabilities": dict(zip(evidence.classes, evidence.probabilities[i].tolist(), strict=True)),
            "quality": float(evidence.quality[i]),
            "unknown": bool(evidence.unknown[i]),
            "reasons": list(evidence.reasons[i]),
        }
        for i, name in enumerate(evidence.labels())
    ]
