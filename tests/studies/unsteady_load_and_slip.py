"""How often 95 % intervals hold the soil where the true load and slip change from row to row and are measured well.

The drives are those of `tests/helpers/unsteady_drive.py`: true changes of 4 % of the load and 0.02 of slip that what
neighbours show would call noise.

    PYTHONPATH=tests/helpers python tests/studies/unsteady_load_and_slip.py --seeds 20
"""

from __future__ import annotations

import argparse
from dataclasses import fields
from pathlib import Path

import numpy as np
from bevameter import Recording, Vehicle, identify
from unsteady_drive import SOIL, WHEEL, drive


def main() -> None:
    """Print the share of intervals that hold the truth, and the median width of the interval of c."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=20)
    names = [field.name for field in fields(SOIL)]
    held, width = [], []
    for seed in range(parser.parse_args().seeds):
        table = drive(seed, (0.04, 0.02), (0.0, 0.0))
        found = identify(
            Recording("test", Path("wheel.csv"), Vehicle(wheels=(WHEEL,)), None, "", "0" * 64, wheel=table)
        ).overall
        assert found is not None
        held.append(
            [found.parameters[name].low <= getattr(SOIL, name) <= found.parameters[name].high for name in names]
        )
        width.append(found.parameters["c_Pa"].high - found.parameters["c_Pa"].low)
    for name, share in zip(names, np.mean(held, axis=0), strict=True):
        print(f"{name}: {100 * share:.0f} % of {len(held)} intervals hold the truth")
    print(f"c_Pa: median width {np.median(width):.0f} Pa")


if __name__ == "__main__":
    main()
