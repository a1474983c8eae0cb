"""Write docs/effects.md, the page of effects, from the catalogue: `python docs/effects_page.py`.

A test (`tests/docs/test_effects_page.py`) fails where the page says something else than the catalogue.
"""

from __future__ import annotations

from pathlib import Path

from bevameter.identification.effects.catalogue import INSTRUMENTS, PHYSICS, forms_by_name
from bevameter.identification.effects.drive import COLUMNS
from bevameter.identification.effects.effect import Effect, Parameter
from bevameter.identification.effects.parse import follows_drive, specimen

PAGE = Path(__file__).resolve().parent / "effects.md"

_HEAD = """# Effects beyond the textbook wheel

This page is written from the catalogue by `python docs/effects_page.py`.

The textbook wheel is the rigid, smooth, driven wheel of Iagnemma & Dubowsky (2002), Eq. 1-9. Each effect below is
something real that it leaves out, or a fault of an instrument. `bevameter simulate` and `bevameter.simulate` add any of
them by its public name, as often as `--effect` is given, in that order:

    bevameter simulate drive.csv --vehicle vehicle.toml --soil soil.toml --effect slip_sinkage:n1=0.2 --out s.csv

- `--effect SLUG:NAME=VALUE,NAME=VALUE`. Numbers are SI, quantities carry their unit (`"torque_offset:T_0=0.5 N m"`).
- Where several forms have the same parameters, `form=` chooses: `slip_sinkage:form=ratio,p=0.8`; the beginning of a
  form's name is enough. Without it the form without a name is taken, where there is one.
- A parameter that is not named stays at the value at which it does nothing, except those marked *required*.
- *Bounds of the drive* follow from the size of the wheel and from what it would sense without the effect; a value
  outside is refused with the bounds in the message.
- *Constants* are part of the formula and taken from the drive. They may be named like a parameter, so that two drives
  share them.
- A row that lacks what an effect needs is answered with nothing, not with a guess; a drive that lacks the column is
  refused.

Symbols are in the [glossary](glossary.md).

## Kept with a class of ground

A soil and the effects that were fitted together with it are one object, `AugmentedSimulator` in
`bevameter.identification.effects.stored`. `AugmentedSimulator.of(model, vector, covariance)` takes over a fit,
`to_json` and
`from_json` write and read it (what is read is checked number by number, whoever wrote it), `simulate` drives it.
`TerrainDatabase.add_physics("sand", simulator, source="drive 3")` keeps it with a class, and from then on
`drawbar_pull` and `mobility` of a new snapshot predict with the newest physics of each class:

- The class is spelt as the database has it from drives: `unknown`, and a name that only case or spaces tell apart from
  a class that is there, are refused, also by a merge, as nothing would match them. A class that no drive has brought
  yet is taken: its physics waits until wheels have felt it.
- The class's soil is then the one that was fitted with the effects; places scatter about it as the stretches show.
- Only effects of the ground act, on any wheel: `slip_sinkage`, `stress_peak_shift`, `exit_angle`, `shear_hump`,
  `hard_layer`,
  `rim_adhesion`, `bulldozing`, `side_wall_friction`, and `grousers[radius]` with the height of the lugs of the wheel
  asked about.
- What the fit may err by is in the bounds: its numbers, soil and effects, are drawn together as they are correlated, on
  top of how places scatter. A number of an effect whose error nobody stated errs by as much as its prior allows, one of
  the soil as much as places of one class commonly differ.
- An effect that is less likely than not is refused: an answer that cannot tell is nothing to plan on.
- Level ground, steady driving and the first wheel in a rut are asked about: effects that wait for a slope, an
  acceleration, a pass number, a place or another speed than the one they were found at do nothing. Tyres, drivetrains
  and faults of
  instruments belong to the vehicle that drove there.
- c, phi and the shear strength that a snapshot tells stay those of the stretches.
"""


def page() -> str:
    """Give the page's text."""
    parts = [_HEAD, "## Physics\n", *map(_section, PHYSICS), "## Instruments\n", *map(_section, INSTRUMENTS)]
    return "\n".join(parts).rstrip() + "\n"


def _section(slug: str) -> str:
    lines = [f"### `{slug}`\n"]
    for effect in forms_by_name(slug, specimen()):
        lines.append(f"- {_title(effect)}{_story(effect)} `{effect.equation}`")
        free = follows_drive(effect)
        alike: dict[str, list[str]] = {}
        for each in effect.parameters:
            alike.setdefault(_bounds(each, effect, each.name in free), []).append(f"`{each.name}`")
        lines += [f"    - {', '.join(names)}{bounds}" for bounds, names in alike.items()]
        if effect.constants:
            lines.append("    - constants: " + ", ".join(f"`{name}`" for name in effect.constants))
        needs = sorted(
            {COLUMNS[need] for need in effect.needs} | {"time_s" for need in effect.needs if "accel" in need}
        )
        lines.append("    - needs " + ", ".join(f"`{name}`" for name in ("load_N", "slip", *needs)))
        lines.append(f"    - source: {effect.source}")
    return "\n".join(lines) + "\n"


def _title(effect: Effect) -> str:
    return f"form `{effect.form}`: " if effect.form else ""


def _story(effect: Effect) -> str:
    """First line of the class's docstring."""
    return (type(effect).__doc__ or "").strip().splitlines()[0]


def _bounds(parameter: Parameter, effect: Effect, free: bool) -> str:
    unit = f" [{parameter.unit}]" if parameter.unit else " [-]"
    within = "bounds of the drive" if free else f"{parameter.low:g} to {parameter.high:g}"
    required = ", required" if parameter.name in effect.required else f", does nothing at {parameter.null:g}"
    if free and parameter.name not in effect.required and parameter.null != 0.0:
        required = ""
    return f"{unit}: {within}{required}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
