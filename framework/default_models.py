"""Which models a recording is recognised by, and why: those of the user, else those that come with the package.

On recordings that call themselves synthetic the package's models of synthetic ground are taken; on others those of real
ground, as far as they are defaults: a model that may be confidently wrong on another vehicle is taken only where a user
names it.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from sqlalchemy.engine import make_url
from sqlalchemy.exc import ArgumentError

from .core.arguments import path_of
from .core.classifier.classifier import TerrainClassifier
from .core.classifier.shipped import ShippedModel, named, shipped_models
from .core.errors import InputError
from .senses import Sense, sense_named
from .senses import senses as all_senses

ModelsGiven = str | Path | Sequence[str | Path] | None
"""What a user gives as models: a folder that holds them, the name of one that comes with the package, or several."""


@dataclass(frozen=True)
class Models:
    """The classifiers of a run, where each is from, and why it is taken.

    Parameters
    ----------
    classifiers
        By name of the sense: ``"vision"``, ``"audio"`` ...
    origins
        By sense: the file that a model was read from, or its name where it came with the package.
    synthetic
        Senses whose model knows synthetic ground only.
    notes
        By sense: which model is taken and why, or why none is.
    cautions
        By sense: what to mind in using what its model says.
    """

    classifiers: dict[str, TerrainClassifier]
    origins: dict[str, str]
    synthetic: tuple[str, ...] = ()
    notes: dict[str, str] = field(default_factory=dict)
    cautions: dict[str, str] = field(default_factory=dict)

    def of(self, senses: Sequence[str]) -> Models:
        """Give those of some senses."""
        return Models(
            {name: each for name, each in self.classifiers.items() if name in senses},
            {name: each for name, each in self.origins.items() if name in senses},
            tuple(name for name in self.synthetic if name in senses),
            {name: each for name, each in self.notes.items() if name in senses},
            {name: each for name, each in self.cautions.items() if name in senses},
        )


def find_models(
    given: ModelsGiven = None,
    database: str | Path | None = None,
    *,
    synthetic: bool = False,
    senses: Sequence[str] | None = None,
) -> Models:
    """Find the model of each sense.

    Those that are given come first, of a folder ``vision.skops``, say; where nothing is given, those next to the
    database, in ``terrain.models`` for ``terrain.db``. A sense that has none there gets the package's own of synthetic
    or of real ground, if that is a default.

    Parameters
    ----------
    given
        Folders where a user put models, each holding at least one, and names of models that come with the package. Of
        two of one sense the later counts.
    database
        Path or SQLAlchemy URL of the terrain database.
    synthetic
        Whether the recording calls itself synthetic (`Recording.synthetic`).
    senses
        Names of those that are needed; all by default.

    Raises
    ------
    InputError
        A folder is missing or holds no model; a model is damaged or of another sense.
    """
    own, found = own_models(given, database), Models({}, {})
    folder = models_of(database) or Path("MODELS")
    for sense in all_senses() if senses is None else map(sense_named, senses):
        name, model = sense.name, own.get(sense.name)
        if isinstance(model, Path):
            found.classifiers[name] = TerrainClassifier.load(model, modality=name)
            found.origins[name] = str(model)
            found.notes[name] = f"{sense.instrument}: {model}, a model of your own"
            continue
        shipped = model or shipped_models().get(f"{name}-{'synthetic' if synthetic else 'real'}")
        if shipped is None:
            continue
        found.notes[name] = f"{sense.instrument}: {_reason(shipped, model is not None, synthetic)}"
        if model is None and not shipped.default:
            continue
        found.classifiers[name] = shipped.load()
        found.origins[name] = shipped.name
        if not synthetic:
            found.cautions[name] = _caution(shipped, sense, folder)
    known = shipped_models()
    of_synthetic = (n for n, each in found.origins.items() if each in known and known[each].ground == "synthetic")
    return Models(found.classifiers, found.origins, tuple(of_synthetic), found.notes, found.cautions)


def _reason(model: ShippedModel, is_named: bool, synthetic: bool) -> str:
    """Say why a model that comes with the package is taken, or why not."""
    if is_named:
        return f"{model.name}, named by --models"
    if not model.default:
        return (
            f"no model of your own. {model.name} is used only where it is named (--models {model.name}): {model.limits}"
        )
    why = "the recording calls itself synthetic" if synthetic else "there is no model of your own"
    return f"{model.name}, which comes with the package, because {why}"


def _caution(model: ShippedModel, sense: Sense, folder: Path) -> str:
    if model.ground == "synthetic":
        return f"{model.name} knows synthetic ground only: on real ground its classes mean nothing"
    better = f"bevameter train {sense.name} LABELLED --out {folder / f'{sense.name}.skops'}"
    known = f"{model.name} knows {', '.join(model.classes)}"
    return f"{known}. Measured: {model.measured}; {model.limits}. A model of your own is better: `{better}`"


def own_models(given: ModelsGiven, database: str | Path | None) -> dict[str, Path | ShippedModel]:
    """Give a user's models by sense, files or such as come with the package.

    Raises
    ------
    InputError
        A folder that is given holds none, or is none.
    """
    if given is None:
        folder = models_of(database)
        return {} if folder is None else dict(_files_in(folder))
    found: dict[str, Path | ShippedModel] = {}
    for each in [given] if isinstance(given, str | os.PathLike) or not isinstance(given, Sequence) else given:
        where = path_of("models", each, "the folder that holds them, or the name of a model")
        shipped = named(where)
        there = {shipped.sense: shipped} if shipped is not None else _files_in(where)
        if not there:
            files = " or ".join(f"{sense.name}.skops" for sense in all_senses())
            expected = f"a folder with {files}, or one of {', '.join(shipped_models())}"
            raise InputError(where, "no model", expected=expected)
        found |= there
    return found


def _files_in(folder: Path) -> dict[str, Path]:
    paths = {sense.name: folder / f"{sense.name}.skops" for sense in all_senses()}
    return {name: path for name, path in paths.items() if path.is_file()}


def models_of(database: str | Path | None) -> Path | None:
    """Give the folder of models that belongs to a database: ``terrain.models`` next to ``terrain.db``.

    None where the database is no file.
    """
    if database is None:
        return None
    text = str(database)
    if "://" in text:
        try:
            url = make_url(text)
        except ArgumentError:
            return None
        if not url.drivername.startswith("sqlite") or url.database in (None, "", ":memory:"):
            return None
        text = str(url.database)
    path = Path(text)
    return path.with_name(f"{path.stem}.models")


def of_real_ground(versions: Iterable[str]) -> tuple[str, ...]:
    """Name the package's own models of real ground among some versions: their classes are often wrong."""
    used = set(versions)
    return tuple(one.name for one in shipped_models().values() if one.ground == "real" and one.version in used)


ANSWER_TOLERANCE = 0.01
"""Most that a probability may differ from that at training [-]: other versions of libraries round otherwise."""


def check_shipped(model: ShippedModel) -> TerrainClassifier:
    """Read a model that comes with the package, and have it answer its example.

    Raises
    ------
    InputError
        A file is missing or is not the one that was made, its card included; or the answer is another one than at
        training, as where a library of this machine makes other features.
    """
    classifier = model.load()
    rows = sense_named(model.sense).classify([model.example_file()], classifier)
    agree = len(rows) == len(model.answers) and all(
        set(now["probabilities"]) == set(then["probabilities"])
        and now["unknown"] == then["unknown"]
        and all(abs(now["probabilities"][name] - p) <= ANSWER_TOLERANCE for name, p in then["probabilities"].items())
        for now, then in zip(rows, model.answers, strict=True)
    )
    if not agree:
        raise InputError(model.file, f"another answer to {model.example} than at training", expected="the same answer")
    if model.version not in model.card:
        raise InputError(model.file.with_suffix(".md"), "the card of another version", expected=model.version)
    return classifier
