"""Python environments that differ from this one in one package, in Python or in pins: made once, kept and used again.

An environment of this Python without other pins is a layer over this one: it holds the release on trial and what that
release needs otherwise, and finds all else here, so that nothing else changes and jax is not installed again.
"""

from __future__ import annotations

import importlib.metadata
import importlib.util
import itertools
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import sysconfig
import tomllib
import venv
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from urllib.parse import urlsplit
from urllib.request import url2pathname

from filelock import FileLock
from packaging.requirements import InvalidRequirement, Requirement
from packaging.utils import InvalidName, canonicalize_name
from packaging.version import InvalidVersion, Version

from evoclaims.core.canonical import content_hash
from evoclaims.core.errors import UserError
from evoclaims.core.files import file_name, read_json, read_text, write_atomically

_NAME: Final = re.compile(r"\s*[\w.-]+")


def without(pins: str, package: str) -> str:
    """Return a file of pins without those of a package; no other character changes."""
    own = canonicalize_name(package)
    named = ((_NAME.match(entry), entry) for entry in _entries(pins))
    return "".join(entry for name, entry in named if not name or canonicalize_name(name[0].strip()) != own)


def _entries(pins: str) -> Iterator[str]:
    """Yield each requirement, option, comment and empty line, with the lines over which it goes on.

    As pip reads them, a line that ends with a backslash goes on, unless it is a comment.
    """
    lines: list[str] = []
    for line in pins.splitlines(keepends=True):
        lines.append(line)
        if line.lstrip().startswith("#") or not line.rstrip("\n").endswith("\\"):
            yield "".join(lines)
            lines = []
    yield "".join(lines)


PROGRAM: Final = "evoclaims"

COMPLETE: Final = "complete.json"
"""Written last into an environment: the versions of all that it finds. A folder without it is made again."""

PIP: Final = ("-m", "pip", "--disable-pip-version-check", "--no-input")


def pip_here() -> tuple[str, ...]:
    """Return `PIP` for this Python; without pip, as in an environment of uv, the one that Python brings for its own."""
    if importlib.util.find_spec("pip") is None and (brings := importlib.util.find_spec("ensurepip")):
        for wheel in (Path(brings.origin or "").parent / "_bundled").glob("pip-*.whl"):
            return (str(wheel / "pip"), *PIP[2:])
    return PIP


_LIST: Final = (
    "import importlib.metadata as m, json; "
    "print(json.dumps({d.name: d.version for d in [*m.distributions()][::-1] if d.name}))"
)
"""Prints the versions of all distributions; of several of one name, that which Python imports."""

MACHINE_CODE: Final = frozenset({"jax", "jaxlib", "llvmlite"})
"""Packages that kernels call in machine code: with older ones than declared, the process may be killed."""

LONGEST: Final = 300
"""Most characters of a reason."""

_ERROR: Final = re.compile(r"^((\S+: )?(?i:error)\s*:\s+|E\s{2,}|\s*×\s+|pyenv:\s+)")
"""How pip, uv, pytest and pyenv begin a line that says what was wrong."""


class NotInstallableError(UserError):
    """An environment cannot be made; the message is the reason, in one line."""


@dataclass(frozen=True)
class Recipe:
    """What an environment is to hold.

    Attributes:
        package, version: the release on trial; both empty for none.
        python: version of Python, such as "3.13"; empty for this one.
        constraints: a file of pins, as pip takes it; None for the versions that are installed here.
    """

    package: str = ""
    version: str = ""
    python: str = ""
    constraints: Path | None = None

    @property
    def label(self) -> str:
        """A short name, such as "evosax 0.3.2, Python 3.13"."""
        release = f"{self.package} {self.version}".strip()
        python = f"Python {self.python}" if self.python else ""
        pins = self.constraints.stem if self.constraints else ""
        return ", ".join(filter(None, [release, python, pins]))

    @property
    def is_layer(self) -> bool:
        """Whether all but the release on trial is as it is here."""
        return not self.python and self.constraints is None

    @property
    def release(self) -> list[str]:
        """The release on trial as installers take it."""
        return [f"{self.package}=={self.version}"] if self.package else []


@dataclass(frozen=True)
class Environment:
    """An environment that has been made.

    Attributes:
        folder: where it is.
        versions: of everything in it, by package.
    """

    folder: Path
    versions: Mapping[str, str]

    @property
    def python(self) -> Path:
        """Its interpreter."""
        return _place(self.folder, "scripts") / "python"

    def moved(self, package: str) -> dict[str, tuple[str | None, str]]:
        """Return what else than a package has another version here, by name: ours and its own."""
        ours = installed_here()
        left_out = {canonicalize_name(package), "pip", "setuptools"}
        return {
            name: (ours.get(name), version)
            for name, version in sorted(self.versions.items())
            if name not in left_out and ours.get(name) != version
        }

    def below(self, package: str, project: Path) -> dict[str, tuple[str, str]]:
        """Return what is older than evoclaims or the project asks for: its version, and the oldest supported one.

        The release on trial may be older, unless the process would die by it: kernels call `MACHINE_CODE` in its own.
        """
        oldest = _oldest(project)
        exempt = {canonicalize_name(package)} - MACHINE_CODE
        return {
            name: (version, str(oldest[name]))
            for name, version in sorted(self.versions.items())
            if name not in exempt and name in oldest and Version(version) < oldest[name]
        }


def make(recipe: Recipe, kept: Path, project: Path, begins: Callable[[], None]) -> Environment:
    """Return the environment of a recipe: the one that an earlier call has made, or a new one.

    Args:
        recipe: what it is to hold.
        kept: the folder of all environments.
        project: the project whose claims it is for, which is installed too where it can be.
        begins: called before a new one is made.

    Raises:
        NotInstallableError: when it cannot be made; nothing of it is left.
    """
    # What is asked for by a folder's address depends on what is declared there, too; extras are not asked for.
    basis = installed_here() if recipe.is_layer else [*_requirements(project), *_declared(project)]
    pins = _pins(recipe)
    key = content_hash([recipe.package, recipe.version, recipe.python, sys.prefix, sys.version, basis, pins])[:12]
    folder = (kept / f"{file_name(recipe.label.replace(' ', '_').replace(',', ''))}.{key}").absolute()
    folder.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(f"{folder}.lock"):
        try:
            return Environment(folder, read_json(folder / COMPLETE))
        except (OSError, ValueError):
            shutil.rmtree(folder, ignore_errors=True)
        begins()
        try:
            return _made(recipe, Environment(folder, {}), project, pins)
        except BaseException as error:
            shutil.rmtree(folder, ignore_errors=True)
            if isinstance(error, OSError | subprocess.CalledProcessError):  # a full disk, or a Python without ensurepip
                raise NotInstallableError(f"its folder cannot be made ({' '.join(str(error).split())})") from error
            raise


def checked(version: str) -> str:
    """Return a version as it was written.

    Raises:
        UserError: when it is invalid.
    """
    try:
        Version(version)
    except InvalidVersion as error:
        raise UserError(f"{version!r} is not a version of a package. Write one such as 0.3.2.") from error
    return version


def checked_name(package: str) -> str:
    """Return the normalized name of a package.

    Raises:
        UserError: when it is invalid; an installer might take it for an option, or for nothing to install.
    """
    try:
        return canonicalize_name(package, validate=True)
    except InvalidName as error:
        raise UserError(f"{package!r} is not the name of a package. Write one such as jax.") from error


def installed_here() -> dict[str, str]:
    """Return the versions of all that this Python finds, by normalized name."""
    found = [(one.name, one.version) for one in importlib.metadata.distributions()]
    return _normalized({name: version for name, version in reversed(found) if name})


def folder_of(package: str, version: str) -> str:
    """Return the address of the folder or repository that a version of a package was installed from here; else empty.

    An installer takes it for the release of that number, which may hold something else.
    """
    if installed_here().get(canonicalize_name(package)) != version:
        return ""
    return str(_origin(package).get("url", ""))


def _oldest(project: Path) -> dict[str, Version]:
    """Return the oldest version of each package that evoclaims and the project declare to work, by normalized name."""
    found: dict[str, Version] = {}
    for text in _declared(project):
        try:
            requirement = Requirement(text)
        except InvalidRequirement:
            continue
        if requirement.marker is not None and not requirement.marker.evaluate({"extra": ""}):
            continue
        lowest = [Version(one.version) for one in requirement.specifier if one.operator in (">=", "~=", ">")]
        name = canonicalize_name(requirement.name)
        if lowest:
            found[name] = max(lowest if name not in found else [*lowest, found[name]])
    return found


def _declared(project: Path) -> list[str]:
    """Return the dependencies that evoclaims and the project declare."""
    own = _described(project).get("dependencies")
    return [*(importlib.metadata.requires(PROGRAM) or ()), *map(str, own if isinstance(own, list) else ())]


def _made(recipe: Recipe, empty: Environment, project: Path, pins: str) -> Environment:
    if recipe.is_layer:
        _begin_layer(empty.folder)
        _run([str(empty.python), *PIP, "install", *recipe.release])
    else:
        uv = _uv()
        _run([uv, "venv", "--python", recipe.python or sys.executable, str(empty.folder)])
        install = [uv, "pip", "install", "--python", str(empty.python)]
        constraints = empty.folder / "constraints.txt"
        constraints.write_text(pins, encoding="utf-8")
        constrained = ["--constraint", str(constraints)] if pins else []
        _run([*install, *constrained, *_requirements(project)])
        if recipe.package:  # apart from the rest, whose metadata may ask for another release
            _run([*install, *constrained, *recipe.release])
    versions = _normalized(json.loads(_run([str(empty.python), "-c", _LIST])))
    found = versions.get(canonicalize_name(recipe.package))
    if recipe.package and Version(found or "0") != Version(recipe.version):
        raise NotInstallableError(f"Python finds {recipe.package} {found or 'nowhere'} before the installed release")
    write_atomically(empty.folder / COMPLETE, json.dumps(versions, indent=1).encode())
    return Environment(empty.folder, versions)


def _begin_layer(folder: Path) -> None:
    """Make an environment that finds first what is installed in it, and then what is installed here."""
    venv.EnvBuilder(symlinks=True, with_pip=importlib.util.find_spec("pip") is None).create(folder)
    bases = [path for path in sys.path if Path(path).name in ("site-packages", "dist-packages")]
    lines = [f"import site; site.addsitedir({base!r})\n" for base in bases]
    (_place(folder, "purelib") / "layer.pth").write_text("".join(lines), encoding="utf-8")


def _uv() -> str:
    """Return the program that makes environments apart from this one: beside this Python, or on the path."""
    beside = os.pathsep.join([sysconfig.get_path("scripts"), os.environ.get("PATH", os.defpath)])
    uv = shutil.which("uv", path=beside)
    if uv is None:
        raise NotInstallableError("uv makes such environments, and is not installed: pip install 'evoclaims[releases]'")
    return uv


def _requirements(project: Path) -> list[str]:
    """Return what an environment apart from this one needs: this program, and the project where it can be installed."""
    described = _described(project)
    own = [] if described.get("name") == PROGRAM else _this_program()
    return [*own, "--editable", str(project.resolve())] if described else own


def _described(project: Path) -> dict[str, Any]:
    """Return the `[project]` table of a project's pyproject.toml; empty without one."""
    try:
        described: dict[str, Any] = tomllib.loads(read_text(project / "pyproject.toml")).get("project", {})
        return described
    except (OSError, ValueError, RecursionError):
        return {}


def _this_program() -> list[str]:
    """Return evoclaims as it was installed here: from a folder, from a repository, or as a release."""
    distribution = importlib.metadata.distribution(PROGRAM)
    origin = _origin(PROGRAM)
    url, repository = str(origin.get("url", "")), origin.get("vcs_info")
    if repository:
        return [f"{PROGRAM} @ {repository['vcs']}+{url}@{repository['commit_id']}"]
    if url.startswith("file://"):
        return [*["--editable"] * bool(origin.get("dir_info", {}).get("editable")), url2pathname(urlsplit(url).path)]
    return [f"{PROGRAM}=={distribution.version}"]


def _origin(package: str) -> dict[str, Any]:
    """Return what says where a package was installed from here; empty for a release."""
    distribution = importlib.metadata.distribution(package)
    origin: dict[str, Any] = json.loads(distribution.read_text("direct_url.json") or "{}")
    return origin


def _pins(recipe: Recipe) -> str:
    """Return the pins of a recipe's file, without that of the release on trial."""
    if recipe.constraints is None:
        return ""
    try:
        pins = read_text(recipe.constraints)
    except (OSError, UnicodeError) as error:
        raise UserError(
            f"Cannot read the constraints {recipe.constraints}: {error}. Name a text file with one requirement on "
            "each line."
        ) from error
    return without(pins, recipe.package)


def _run(command: Sequence[str]) -> str:
    """Run a command and return what it printed.

    Raises:
        NotInstallableError: with the last line of its output, when it fails.
    """
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONHOME"}
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", env=environment, check=False)
    if done.returncode:
        why = "" if done.returncode < 0 else reason(done.stdout + done.stderr)
        raise NotInstallableError(why or f"{Path(command[0]).name} {ending(done.returncode)}")
    return done.stdout


def ending(status: int) -> str:
    """Return how a process ended, such as "was killed by SIGSEGV" or "ended with 2"."""
    if status < 0 and -status in set(signal.Signals):
        return f"was killed by {signal.Signals(-status).name}"
    return f"ended with {status}"


def reason(output: str) -> str:
    """Return in a line why a command has failed: its last error with what belongs to it, or else its last line."""
    lines = [line.rstrip() for line in output.splitlines() if line.strip(" =\t")]
    errors = [index for index, line in enumerate(lines) if _ERROR.match(line)]
    first = errors[-1] if errors else len(lines) - 1
    more = itertools.takewhile(lambda line: line.startswith((" ", "╰", "│")), lines[first + 1 :])
    whole = " ".join(_ERROR.sub("", " ".join([*lines[first : first + 1], *more])).split())
    return (whole if len(whole) <= LONGEST else f"{whole[:LONGEST]}…").removesuffix(".")


def _normalized(versions: Mapping[str, str]) -> dict[str, str]:
    return dict(sorted((str(canonicalize_name(name)), version) for name, version in versions.items()))


def _place(folder: Path, name: str) -> Path:
    """Return a folder of an environment in `folder`: its "scripts", or its "purelib" (site-packages)."""
    return Path(sysconfig.get_path(name, "venv", {"base": str(folder)}))
