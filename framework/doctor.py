"""Whether an installation, the models and a terrain database are in order.

Which packages are needed is read from the metadata of the installed package. Of it nothing that imports them is
imported here before they are known to be in order: what is broken is to be named, whatever it is.
"""

from __future__ import annotations

import platform
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass
from importlib import import_module, metadata
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name
from packaging.version import InvalidVersion

from .core.errors import InputError
from .core.plugins import import_fault

if TYPE_CHECKING:
    from .core.classifier.shipped import ShippedModel

_NAME = "bevameter"
REINSTALL = f"python -m pip install --force-reinstall --no-deps {_NAME}"
"""What mends a file of the package."""


@dataclass(frozen=True)
class Check:
    """One thing that was looked at.

    Parameters
    ----------
    subject
        Its kind: ``"installation"``, ``"dependency"``, ``"extra"``, ``"plug-in"``, ``"model"`` or ``"database"``.
    name
        Which one.
    found
        What is there, such as a version.
    required
        Which version is required; empty where none is.
    problem
        Why it needs attention; empty where it needs none.
    remedy
        What to do about it, or, without a problem, what adds what is not there.
    """

    subject: str
    name: str
    found: str
    required: str = ""
    problem: str = ""
    remedy: str = ""


@dataclass(frozen=True)
class Diagnosis:
    """What `diagnose` found."""

    checks: tuple[Check, ...]

    @property
    def problems(self) -> tuple[Check, ...]:
        """What needs attention."""
        return tuple(check for check in self.checks if check.problem)

    def as_dict(self) -> dict[str, Any]:
        """Everything in types of JSON."""
        return {"problems": len(self.problems), "checks": [asdict(check) for check in self.checks]}


def diagnose(database: str | Path | None = None, *, progress: Callable[[str, float], None] | None = None) -> Diagnosis:
    """Look at the installation, the models, and a terrain database; nothing is changed.

    Every package that is needed is imported. Models and database are looked at only where all of them can be.

    Parameters
    ----------
    database
        Path or SQLAlchemy URL of a terrain database. Models next to it are looked at, too.
    progress
        Called with ``"checking"`` and the share of the database that is checked, in [0, 1].

    Raises
    ------
    InputError
        No such database, not one of ours, of a newer version, or it cannot be reached.
    """
    checks = list(_installation())
    if any(check.problem for check in checks if check.subject in ("installation", "dependency")):
        unseen = "plug-ins, models" + (" and database" if database is not None else "")
        checks.append(Check("installation", unseen, "not looked at: what is needed is not in order"))
    else:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of plug-ins that are left out, which have lines of their own
            checks += [*_plugins(), *_models(database)]
        if database is not None:
            checks.append(_database(database, progress))
    return Diagnosis(tuple(checks))


def _installation() -> Iterator[Check]:
    where, code = Path(__file__).parents[1], import_module(_NAME).__version__
    try:
        about = metadata.metadata(_NAME)
    except metadata.PackageNotFoundError:
        problem = "is not installed: nobody knows what it needs"
        yield Check("installation", _NAME, code, "", problem, f"install what is in {where} with pip")
        return
    python, needed = platform.python_version(), (about.get_all("Requires-Python") or [""])[0]
    wrong = "" if _meets(python, SpecifierSet(needed)) else f"{needed} is required"
    yield Check("installation", "python", python, needed, wrong, "make a new environment with it" if wrong else "")
    wrong = "" if about["Version"] == code else f"the code that runs is {code}: pip knows another version"
    yield Check(
        "installation", _NAME, about["Version"], "", wrong, f"install what is in {where} again" if wrong else ""
    )

    base, providers = _requirements(_NAME), metadata.packages_distributions()
    for requirement in base:
        yield _dependency(requirement, providers)
    for requirement, user in _unmet(base):
        if requirement not in base:
            version = _version(requirement.name) or "none"
            problem = f"{user} requires {_spelt(requirement)}"
            yield Check(
                "dependency", requirement.name, version, str(requirement.specifier), problem, _pip([requirement])
            )
    for extra in about.get_all("Provides-Extra") or ():
        yield _extra(extra, [each for each in _requirements(_NAME, (extra,)) if each not in base], providers)


def _requirements(distribution: str, extras: Iterable[str] = ()) -> list[Requirement]:
    """Give what an installed distribution, and extras of it, require on this system."""
    given = map(Requirement, metadata.requires(distribution) or ())
    chosen = ("", *extras)
    return [one for one in given if one.marker is None or any(one.marker.evaluate({"extra": name}) for name in chosen)]


def _version(distribution: str) -> str | None:
    """Give the installed version; None where there is none, or where its metadata are lost."""
    try:
        return metadata.version(distribution)
    except (metadata.PackageNotFoundError, KeyError):
        return None


def _meets(version: str | None, specifier: SpecifierSet) -> bool:
    try:
        return version is not None and specifier.contains(version, prereleases=True)
    except InvalidVersion:
        return False


def _unmet(requirements: Iterable[Requirement]) -> list[tuple[Requirement, str]]:
    """Give what is not met of requirements and of all that these require in turn, each with who requires it."""
    unmet, seen = [], set()
    waiting = [(requirement, _NAME) for requirement in requirements]
    for requirement, user in waiting:  # which grows
        if not _meets(_version(requirement.name), requirement.specifier):
            unmet.append((requirement, user))
        elif (key := (canonicalize_name(requirement.name), frozenset(requirement.extras))) not in seen:
            seen.add(key)
            waiting += [(each, requirement.name) for each in _requirements(requirement.name, requirement.extras)]
    return unmet


def _dependency(requirement: Requirement, providers: Mapping[str, list[str]]) -> Check:
    name, version, needed = requirement.name, _version(requirement.name), str(requirement.specifier)
    if not _meets(version, requirement.specifier):
        problem = "is not installed" if version is None else f"{needed} is required"
        return Check("dependency", name, version or "none", needed, problem, _pip([requirement]))
    module = _module(name)
    others = {canonicalize_name(each) for each in providers.get(module, ())} - {canonicalize_name(name)}
    reinstall = _pip([requirement], "--force-reinstall --no-deps ")
    spec = find_spec(module) if others else None
    if spec is not None and spec.origin is not None:  # a namespace package, which may be shared, has none
        names = " and ".join(sorted(others))
        problem = f"{names} brings {module}, too: the files of one have replaced those of the other"
        return Check(
            "dependency", name, version or "", needed, problem, f"python -m pip uninstall {names}, then {reinstall}"
        )
    try:
        if module:
            import_module(module)
    except Exception as error:  # whatever a broken installation raises
        problem = f"cannot be imported: {type(error).__name__}: {error}"
        return Check("dependency", name, version or "", needed, problem, reinstall)
    return Check("dependency", name, version or "", needed)


def _extra(extra: str, requirements: list[Requirement], providers: Mapping[str, list[str]]) -> Check:
    """Say what an extra lacks, which is no problem, and what of it is there and not in order, which is one."""
    unmet = {requirement: user for requirement, user in _unmet(requirements)}
    absent = [each for each in unmet if _version(each.name) is None]
    problems = [
        f"{each.name} is {_version(each.name)}, and {user} requires {each.specifier}"
        for each, user in unmet.items()
        if each not in absent
    ]
    broken = [
        check for check in (_dependency(each, providers) for each in requirements if each not in unmet) if check.problem
    ]
    problems += [f"{check.name} {check.problem}" for check in broken]
    remedies = [_pip(unmet)] * bool(unmet) + [check.remedy for check in broken]
    found = f"not installed: {', '.join(each.name for each in absent)}" if absent else "complete"
    return Check("extra", extra, "not in order" if problems else found, "", "; ".join(problems), "; ".join(remedies))


def _module(distribution: str) -> str:
    """Name the module that a distribution is for: of those that it brings the one with most files; empty if none."""
    files: Counter[str] = Counter()
    for file in metadata.files(distribution) or ():
        top = file.parts[0].partition(".")[0]
        if file.suffix in (".py", ".so", ".pyd") and top.isidentifier() and not top.startswith("_"):
            files[top] += 1
    return max(files, key=files.__getitem__, default="")


def _spelt(requirement: Requirement) -> str:
    extras = f"[{','.join(sorted(requirement.extras))}]" if requirement.extras else ""
    return f"{requirement.name}{extras}{requirement.specifier}"


def _pip(requirements: Iterable[Requirement], options: str = "") -> str:
    names = dict.fromkeys(f'"{_spelt(requirement)}"' for requirement in requirements)
    return f"python -m pip install {options}{' '.join(names)}"


def _plugins() -> Iterator[Check]:
    groups = sorted(group for group in metadata.entry_points().groups if group.startswith(f"{_NAME}."))
    for point in [point for group in groups for point in metadata.entry_points(group=group)]:
        owner = "unknown" if point.dist is None else f"{point.dist.name} {point.dist.version}"
        fault = import_fault(point)
        problem = f"{point.value} cannot be imported: {fault}" if fault else ""
        remedy = f"install or remove the distribution that brings it: {owner}" if fault else ""
        yield Check("plug-in", f"{point.group} {point.name}", owner, "", problem, remedy)


def _models(database: str | Path | None) -> Iterator[Check]:
    from .core.classifier.shipped import shipped_models
    from .default_models import models_of, own_models
    from .senses import senses

    folder = models_of(database)
    try:
        own = own_models(None, database)
        unread = {path for path in folder.glob("*.skops") if path not in own.values()} if folder is not None else ()
    except OSError as error:
        problem = f"cannot be read: {error.strerror}"
        yield Check("model", str(folder), "unknown", "", problem, "make the folder readable")
        return
    for sense in senses():
        if isinstance(path := own.get(sense.name), Path):
            yield _model(path, sense.name)
    for path in sorted(unread):
        problem = "there is no sense of this name: no run uses it"
        yield Check(
            "model", str(path), "not read", "", problem, f"call it {' or '.join(f'{s.name}.skops' for s in senses())}"
        )
    try:
        shipped = shipped_models()
    except InputError as error:
        yield Check("model", "those of the package", "not read", "", str(error), REINSTALL)
        return
    yield from map(check_of_shipped, shipped.values())


def _model(path: Path, sense: str) -> Check:
    """Read a user's model as a run does."""
    from .core.classifier.classifier import TerrainClassifier
    from .senses import sense_named

    try:
        model = TerrainClassifier.load(path, modality=sense)
        sense_named(sense).classify([], model)  # refuses a model whose features are not those of this version
    except InputError as error:
        return Check("model", sense, str(path), "", str(error), f"make it again with bevameter train {sense}")
    return Check("model", sense, f"version {model.version}, {len(model.classes)} classes, {path}")


def check_of_shipped(model: ShippedModel) -> Check:
    """Check a model that comes with the package: its files' digests, that it loads, and how it answers its example."""
    from .default_models import check_shipped

    try:
        check_shipped(model)
    except InputError as error:
        return Check("model", model.name, str(model.file), "", str(error), REINSTALL)
    return Check(
        "model", model.name, f"version {model.version[:12]}, {len(model.classes)} classes, {model.ground} ground"
    )


def _database(database: str | Path, progress: Callable[[str, float], None] | None) -> Check:
    from ..database.check import check
    from ..database.info import info
    from ..database.urls import parse_url, shown

    name = shown(parse_url(database))
    report = check(database, progress=progress)
    if report.faults:
        first = report.faults[0].as_dict()
        where = " ".join(part for part in (first["table"], first["id"]) if part)
        problem = f"faults: {len(report.faults)}; the first: {where + ': ' if where else ''}{first['problem']}"
        return Check("database", name, "not sound", "", problem, f"bevameter db check {name}")
    held = info(database)
    found = f"sound; schema {held.schema}, sites: {len(held.sites)}, drives: {report.rows.get('drive', 0)}"
    older = held.schema != held.newest_schema
    return Check("database", name, found, remedy=f"bevameter db migrate {name}" if older else "")
