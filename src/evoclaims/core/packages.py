"""The packages that a computation depends on: where they are declared, and their installed or recorded versions."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any, Final

from evoclaims.core.canonical import content_hash
from evoclaims.core.errors import UserError
from evoclaims.core.provenance import PACKAGES, changing_flags, flags_that_change, version_of

Versions = Mapping[str, str | None]
"""Package versions by name, None if not installed; and under `FLAGS` the flags of XLA that change a trial, if any."""

FLAGS: Final = "XLA_FLAGS"
"""Flags by which XLA compiles otherwise decide, like versions, which stored trial answers."""

ALWAYS: Final = ("jax", "jaxlib", "numpy")
"""Used by every trial."""

UNDECLARED: Final = tuple(name for name in PACKAGES if name not in ("evoclaims", *ALWAYS))
"""Assumed for a component without a declaration; evoclaims is left out, as its revisions are in the trial's id."""

DEPENDS_ON: Final = "depends_on"
"""Key under which a trial's provenance lists the packages that its condition depends on."""

SHORT_HASH: Final = 16
"""Digits of the version hash in a file name."""


def packages_of(component: Any) -> tuple[str, ...]:
    """Return the packages beyond `ALWAYS` that a method or task depends on, as declared in its `packages`.

    Without a declaration, it is assumed to depend on every package whose version is recorded. Its fields count too:
    a wrapped method or task, and any part, such as a network, that declares `packages`.

    Raises:
        UserError: when a `packages` is not a tuple of names.
    """
    declared = getattr(component, "packages", UNDECLARED)
    if not isinstance(declared, tuple) or not all(isinstance(name, str) for name in declared):
        raise UserError(
            f"The packages of {getattr(component, 'name', component)} are {declared!r}. Write a tuple of their names, "
            'such as packages = ("optax",), or () when it needs nothing beyond jax and numpy.'
        )
    return tuple(sorted({*declared, *(name for part in _parts(component) for name in packages_of(part))}))


def absent(component: Any) -> tuple[str, ...]:
    """Return the packages that a component and its parts declare, and that are not installed, or are misspelled.

    Those that this project knows are not looked at: some are optional, and imports miss the others.
    """
    return tuple(name for name in packages_of(component) if name not in PACKAGES and version_of(name) is None)


def _parts(component: Any) -> Iterator[Any]:
    """Yield the parts in a component's fields that have their own packages: wrapped components, declaring parts."""
    held: list[Any] = [component]
    while held:
        one = held.pop()
        if isinstance(one, Mapping):
            inner = list(one.values())
        elif isinstance(one, tuple | list):
            inner = list(one)
        elif dataclasses.is_dataclass(one):
            inner = [getattr(one, field.name) for field in dataclasses.fields(one)]
        else:
            continue
        for part in inner:
            if hasattr(part, "packages") or (hasattr(part, "revision") and hasattr(part, "step")):
                yield part
            else:
                held.append(part)


def installed(packages: tuple[str, ...]) -> dict[str, str | None]:
    """Return the package versions in this environment, and the flags that change its trials if there are any."""
    return _with_flags({name: version_of(name) for name in packages if name != FLAGS}, changing_flags(), packages)


def recorded(provenance: Mapping[str, Any], packages: tuple[str, ...]) -> dict[str, str | None]:
    """Return the package versions recorded in a provenance, None where none is recorded, and flags as `installed`."""
    known = provenance.get("versions") or {}
    flags = flags_that_change(provenance.get("xla_flags"))
    return _with_flags({name: known.get(name) for name in packages if name != FLAGS}, flags, packages)


def _with_flags(versions: dict[str, str | None], flags: str | None, asked: tuple[str, ...]) -> dict[str, str | None]:
    """Add the flags, if there are any, or if they are asked for by name."""
    return {**versions, FLAGS: flags} if flags or FLAGS in asked else versions


def without_flags(versions: Versions) -> dict[str, str | None]:
    """Return the versions of packages alone."""
    return {name: version for name, version in versions.items() if name != FLAGS}


def depends_on(provenance: Mapping[str, Any]) -> tuple[str, ...] | None:
    """Return the packages that a provenance lists as its trial's dependencies; None for old ones without a list."""
    names = provenance.get(DEPENDS_ON)
    return None if names is None else tuple(names)


def agree(provenance: Mapping[str, Any], versions: Versions) -> bool:
    """Whether a provenance has exactly these versions, and these flags or none."""
    return _set(recorded(provenance, tuple(versions))) == _set(versions)


def short_hash(versions: Versions) -> str:
    """Return the hash of versions used in a record's file name."""
    return content_hash(_set(versions))[:SHORT_HASH]


def _set(versions: Versions) -> dict[str, str | None]:
    return {name: version for name, version in versions.items() if name != FLAGS or version is not None}


def differences(old: Versions, new: Versions) -> dict[str, tuple[str | None, str | None]]:
    """Return packages with different versions, and both versions."""
    names = sorted(old.keys() | new.keys())
    return {name: (old.get(name), new.get(name)) for name in names if old.get(name) != new.get(name)}
