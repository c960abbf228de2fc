"""Which packages a method or task depends on, and what their versions say of a stored trial."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import version
from typing import Any, ClassVar

import pytest

from evoclaims.core import packages
from evoclaims.core.errors import UserError
from evoclaims.core.packages import UNDECLARED, agree, depends_on, differences, installed, packages_of, short_hash
from evoclaims.core.provenance import PACKAGES


@dataclass(frozen=True)
class Undeclared:
    revision: ClassVar[int] = 1

    def step(self) -> None: ...


@dataclass(frozen=True)
class Declared(Undeclared):
    packages: ClassVar[Any] = ("optax", "brax")


@dataclass(frozen=True)
class Part:
    packages: ClassVar[Any] = ("flax",)


@dataclass(frozen=True)
class Settings:
    """A plain part, which has nothing to declare, around something that has."""

    inner: Any = None


@dataclass(frozen=True)
class Wrapper(Undeclared):
    packages: ClassVar[Any] = ()
    inner: Any = None


def test_what_declares_nothing_depends_on_every_package_whose_version_is_recorded() -> None:
    assert packages_of(Undeclared()) == tuple(sorted(UNDECLARED))
    assert {*UNDECLARED, "evoclaims", "jax", "jaxlib", "numpy"} == set(PACKAGES)


@pytest.mark.parametrize(
    ("inner", "packages"),
    [
        (None, ()),
        (Settings(), ()),
        (Declared(), ("brax", "optax")),
        (Settings((1, {"network": Part()})), ("flax",)),
        (Wrapper(Settings([Declared(), Part()])), ("brax", "flax", "optax")),
        (Undeclared(), tuple(sorted(UNDECLARED))),
    ],
)
def test_a_wrapper_depends_on_what_it_wraps_depends_on(inner: Any, packages: tuple[str, ...]) -> None:
    assert packages_of(Wrapper(inner)) == packages


@pytest.mark.parametrize("packages", ["optax", None, ["optax"], (1,)])
def test_a_declaration_of_another_type_is_a_sentence(packages: Any) -> None:
    component = type("Odd", (), {"name": "odd", "packages": packages})()
    with pytest.raises(UserError, match=r"The packages of odd are .*\. Write a tuple of their names"):
        packages_of(component)


def test_versions_agree_when_all_of_them_do() -> None:
    versions = {"jax": "1.0", "qdax": None}
    assert agree({"versions": {"jax": "1.0", "qdax": None, "optax": "9"}}, versions)
    assert agree({"versions": {"jax": "1.0"}}, versions)
    for other in ({"jax": "1.1"}, {"qdax": None}, {"jax": "1.0", "qdax": "1"}, None):
        assert not agree({"versions": other}, versions)
    assert not agree({}, versions)


def test_the_hash_of_versions_depends_on_names_and_versions_alone() -> None:
    versions = {"jax": "1.0", "qdax": None}
    assert short_hash(versions) == short_hash(dict(reversed(versions.items())))
    others = ({"jax": "1.0"}, {"jax": "1.1", "qdax": None}, {"jax": "1.0", "qdax": "none"}, {})
    assert len({short_hash(versions), *map(short_hash, others)}) == 5


def test_a_provenance_that_does_not_say_what_its_trial_depends_on_is_an_old_one() -> None:
    assert depends_on({"depends_on": ["jax", "optax"]}) == ("jax", "optax")
    assert depends_on({}) is depends_on({"depends_on": None}) is None


def test_installed_versions_and_their_differences(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(packages, "changing_flags", lambda: None)
    here = installed(("numpy", "evoclaims-no-such-package"))
    assert here == {"numpy": version("numpy"), "evoclaims-no-such-package": None}
    assert differences(here, {**here, "numpy": "0"}) == {"numpy": (version("numpy"), "0")}
    monkeypatch.setattr(packages, "changing_flags", lambda: "--xla_a=1")
    flagged = installed(("numpy",))
    assert differences(installed(("numpy", "XLA_FLAGS")), flagged) == {}
    assert flagged == {"numpy": version("numpy"), "XLA_FLAGS": "--xla_a=1"}
