"""Write the example on docs/explain.md from `bevameter explain` on the real sand of ../shared/data.

python docs/explain_page.py
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "explain.md"
SAND = ROOT.parent / "shared" / "data" / "single-wheel-sand"
BEGIN, END = "\nprints\n", "## How to read the report"


def main() -> None:
    """Run the command and put what it prints between the two marks of the page."""
    command = [
        sys.executable,
        "-m",
        "bevameter.framework.cli.main",
        "explain",
        "wheel.csv",
        "--vehicle",
        "vehicle.toml",
    ]
    done = subprocess.run(command, cwd=SAND, capture_output=True, text=True, check=True)
    printed = "\n".join(f"    {line.rstrip()}" if line.strip() else "" for line in done.stdout.splitlines())
    before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN, 1)
    after = rest[rest.index(END) :]
    PAGE.write_text(f"{before}{BEGIN}\n{printed}\n\n{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
