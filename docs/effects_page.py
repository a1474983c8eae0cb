"""Write docs/effects.md, the page of effects, from the catalogue: `python docs/effects_page.py`.

A test (`tests/docs/test_effects_page.py`) fails where the page differs from the catalogue.
"""

from __future__ import annotations

from pathlib import Path

from bevameter.identification.effects.catalogue import REGISTRY, forms_by_name
from bevameter.identification.effects.drive import COLUMNS
from bevameter.identification.effects.effect import Effect, Parameter
from bevameter.identification.effects.parse import follows_drive, specimen
from bevameter.identification.mechanics.textbook import CHANNELS

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
- *Bounds of the drive* follow from the size of the wheel and from what it would sense without the effect. A value
  outside is refused, with the bounds in the message.
- The *prior* is a normal distribution about the value at which the effect does nothing, or about the usual one. Its
  standard deviation is given, and where that comes from.
- *Constants* are part of the formula and taken from the drive. They may be named like a parameter, so that two drives
  share them.
- *Changes* lists the channels that an effect changes; `explain` considers it where one of them was measured.
- A row that lacks what an effect needs is answered with nothing, not with a guess; a drive that lacks the column is
  refused.

Symbols are in the [glossary](glossary.md). A new effect is one file: see [contributing](contributing.md#add-an-effect).

## Kept with a class of ground

A soil and the effects that were fitted together with it are one object, `AugmentedSimulator` in
`bevameter.identification.effects.stored`. `AugmentedSimulator.of(model, vector, covariance)` takes over a fit,
`to_json` and
`from_json` write and read it (what is read is checked number by number, whoever wrote it), `simulate` drives it.
`TerrainDatabase.add_physics("sand", simulator, source="drive 3")` keeps it with a class, and from then on
`drawbar_pull` and `mobility` of a new snapshot predict with the newest physics of each class:

- The class is spelt as the database has it from drives. `unknown` is refused, and so is a name that differs from an
  existing class in case or spaces only. A merge refuses them, too. A class that no drive has brought yet is accepted:
  its physics is used once its soil was measured.
- The class's soil is then the one that was fitted with the effects; places scatter about it as the stretches show.
- Only effects of the ground act, on any wheel: %GROUND%.
  Lugs shear at the height of those of the wheel that is predicted.
- The bounds include the error of the fit: soil and effects are drawn with their correlations, in addition to the
  scatter between places. A parameter of an effect without a stated error has that of its prior, one of the soil the
  scatter that places of one class commonly show.
- An effect with a probability below 0.5 is refused.
- Predictions are of level ground, steady driving and the first wheel in a rut. Effects of slope, acceleration, number
  of the pass, place, and of another speed than the one they were found at do nothing. Tyres, drivetrains and faults of
  instruments belong to the vehicle that drove there.
- `bevameter run` subtracts from the wheel channels what the effects of a class add there, before the soil is
  identified. Effects of the ground are subtracted on any vehicle. Those of the vehicle and its instruments are
  subtracted where the vehicle has the name of the one that they were found on. Drifts, run-to-run zeros and patches of
  soil belong to one drive and stay. The intervals of the stretches do not include the error of the effects' parameters;
  the planner's bounds do. A drive that was processed before the physics was stored is processed again.
- c, phi and the shear strength of a snapshot are those of the stretches.
"""


def page() -> str:
    """Give the page's text."""
    titles = {"physics": "## Physics\n", "instrument": "## Instruments\n"}
    ground = ", ".join(f"`{slug}`" for slug, effect in REGISTRY.items() if effect.of_any_wheel)
    parts = [_HEAD.replace("%GROUND%", ground)]
    for kind, title in titles.items():
        parts += [title, *(_section(slug) for slug, effect in REGISTRY.items() if effect.kind == kind)]
    return "\n".join(parts).rstrip() + "\n"


def _section(slug: str) -> str:
    effect = REGISTRY[slug]
    lines = [f"### `{slug}`\n", f"{effect.title[0].upper()}{effect.title[1:]}: {effect.what_happens}.\n"]
    lines += [f"Check: {effect.check}.\n", "Priors:\n"]
    forms = forms_by_name(slug, specimen())
    sources: dict[str, list[str]] = {}
    for each in (parameter for form in forms for parameter in form.parameters):
        names = sources.setdefault(each.source, [])
        if f"`{each.name}`" not in names:
            names.append(f"`{each.name}`")
    lines += [f"- {_listed(names)}: {source}" for source, names in sources.items()]
    facts = [_facts(form) for form in forms]
    common = [fact for fact in facts[0] if all(fact in others for others in facts)]
    lines += ["", *(f"{fact[0].upper()}{fact[1:]}.\n" for fact in common)]
    for form in forms:
        lines.append(f"- {_title(form)}{_story(form)} `{form.equation}`")
        free = follows_drive(form)
        alike: dict[str, list[str]] = {}
        for each in form.parameters:
            alike.setdefault(_bounds(each, form, each.name in free), []).append(f"`{each.name}`")
        lines += [f"    - {_listed(names)}{bounds}" for bounds, names in alike.items()]
        if form.constants:
            lines.append("    - constants: " + ", ".join(f"`{name}`" for name in form.constants))
        lines += [f"    - {fact}" for fact in _facts(form) if fact not in common]
    return "\n".join(lines) + "\n"


def _facts(form: Effect) -> list[str]:
    """What a form needs and changes, and its source."""
    needs = sorted({COLUMNS[need] for need in form.needs} | {"time_s" for need in form.needs if "accel" in need})
    return [
        "needs " + ", ".join(f"`{name}`" for name in ("load_N", "slip", *needs)),
        "changes " + ", ".join(f"`{CHANNELS[channel]}`" for channel in sorted(form.changes)),
        f"source: {form.source}",
    ]


def _title(form: Effect) -> str:
    return f"form `{form.form}`: " if form.form else ""


def _story(form: Effect) -> str:
    """First line of the class's docstring."""
    return (type(form).__doc__ or "").strip().splitlines()[0]


def _listed(names: list[str]) -> str:
    return ", ".join(names) if len(names) < 7 else f"{names[0]} to {names[-1]}"


def _bounds(parameter: Parameter, form: Effect, free: bool) -> str:
    unit = f" [{parameter.unit}]" if parameter.unit else " [-]"
    within = "bounds of the drive" if free else f"{parameter.low:g} to {parameter.high:g}"
    required = ", required" if parameter.name in form.required else f", does nothing at {parameter.null:g}"
    if free and parameter.name not in form.required and parameter.null != 0.0:
        required = ""
    prior = "" if free else f", prior {parameter.null:g} +- {parameter.scale:g}"
    return f"{unit}: {within}{required}{prior}"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
