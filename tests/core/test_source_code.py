"""The hashes of a project's own code change with what computes, and with nothing else."""

from __future__ import annotations

import cmath
import importlib
import math
import sys
from collections.abc import Callable, Iterator
from functools import reduce
from pathlib import Path
from typing import Any

import jax.numpy
import pytest

from evoclaims import TrainingLoop
from evoclaims.core import source_code
from evoclaims.core.source_code import PARTS, code_of, is_edited
from evoclaims.envs import NParity
from evoclaims.methods import HandBuilt

METHOD = '''
"""A method."""
import dataclasses
from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import jax
from evoclaims.methods import CmaEs

import its_helpers
from its_helpers import Part

RATE = 0.5
UNUSED = 1


@partial(jax.jit, static_argnums=1)
def moved(x, far):
    return x + its_helpers.shift(far)


def unused(x):
    return x


@dataclass(frozen=True)
class Own(CmaEs):
    """Climbs."""

    name: ClassVar[str] = "own"
    revision: ClassVar[int] = 1
    power: ClassVar[int] = 2
    spread: float = 0.5
    part: Part = Part()

    def step(self, x):
        """Take a step."""
        y = moved(x, RATE)  # up
        return y ** self.power


def trained(task, seed, budget):
    return {"last_fitness": RATE}


class Trainer:
    @staticmethod
    def alone(task, seed, budget):
        return {"last_fitness": RATE}

    @classmethod
    def train(cls, task, seed, budget):
        return cls.alone(task, seed, budget)
'''

HELPERS = """
from dataclasses import dataclass


def shift(far):
    return far + 1


@dataclass(frozen=True)
class Base:
    def twice(self, x):
        return 2 * x


@dataclass(frozen=True)
class Part(Base):
    width: int = 3
"""

Found = Callable[..., dict[str, str]]


@pytest.fixture
def found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Found]:
    """Return a function that writes the two files with a replacement, and returns the hashes of `make(module)`."""
    monkeypatch.syspath_prepend(str(tmp_path))
    names = ("its_method", "its_helpers")

    def forget() -> None:
        for name in names:
            sys.modules.pop(name, None)

    def find(
        old: str = "",
        new: str = "",
        make: Callable[[Any], Any] = lambda module: module.Own(),
        method: str = METHOD,
        helpers: str = HELPERS,
    ) -> dict[str, str]:
        assert old in method + helpers
        for name, text in zip(names, (method, helpers), strict=True):
            (tmp_path / f"{name}.py").write_text(text.replace(old, new) if old else text, encoding="utf-8")
        forget()
        importlib.invalidate_caches()
        sys.dont_write_bytecode, before = True, sys.dont_write_bytecode
        try:
            return code_of(make(importlib.import_module("its_method")), NParity(2))
        finally:
            sys.dont_write_bytecode = before

    yield find
    forget()


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("y ** self.power", "y * self.power"),
        ("power: ClassVar[int] = 2", "power: ClassVar[int] = 3"),
        ("x + its_helpers", "x - its_helpers"),
        ("RATE = 0.5", "RATE = 0.25"),
        ("return far + 1", "return far + 2"),
    ],
)
def test_what_computes_changes_the_hash_of_the_method(found: Found, old: str, new: str) -> None:
    before, after = found(), found(old, new)
    assert before.keys() == after.keys() == {"its_method.Own", "its_helpers.Part"}
    assert before["its_method.Own"] != after["its_method.Own"]
    assert before["its_helpers.Part"] == after["its_helpers.Part"]


CHAIN = ("import its_helpers\n", "import sys\nimport its_helpers\nhere = sys.modules[__name__]\n")
CHAINED = METHOD.replace(*CHAIN).replace("x + its_helpers.shift", "x + here.its_helpers.shift")


def test_what_is_named_through_several_modules_is_part_of_it(found: Found) -> None:
    before, after = found(METHOD, CHAINED), found("return far + 1", "return far + 2", method=CHAINED)
    assert before["its_method.Own"] != after["its_method.Own"]


@pytest.mark.parametrize("table", ["[0.5, {0}]", "{{'rate': {0}}}", "(None, [{0}])"])
def test_lists_and_tables_of_constants_are_part_of_it(found: Found, table: str) -> None:
    one, other = (found("RATE = 0.5", f"RATE = {table.format(value)}") for value in (1, 2))
    assert one["its_method.Own"] != other["its_method.Own"]


@pytest.mark.parametrize(
    "table",
    [
        "jax.numpy.array([0.5, {0}])",
        "__import__('numpy').int64({0})",
        "[0.5, {{'rate': jax.numpy.ones({0})}}]",
        "CmaEs({0}0)",
        "frozenset([{0}])",
        "partial(max, {0})",
        "jax.jit(partial(max, {0}))",
        "[partial(max, {0})]",
        "{{'rate': lambda x: {0}}}",
        "type('', (), {{}})\n\n\nclass RATE:\n    rate: float = {0}",
        "{0}\n\n\nclass RATE:\n    rate: float = RATE",
        "1\n\n\n@dataclass(frozen=True)\nclass RATE(Part):\n    rate: float = {0}",
        "1\n\n\n@dataclass\nclass RATE:\n    rate: list = dataclasses.field(default_factory=lambda: {0})",
    ],
)
def test_arrays_and_objects_are_part_of_it_and_records_of_older_releases_lack_them(found: Found, table: str) -> None:
    one, same, other = (found("RATE = 0.5", f"RATE = {table.format(value)}")["its_method.Own"] for value in (1, 1, 2))
    assert one == same != other
    assert is_edited(one, other)
    assert is_edited(None, one)
    assert not is_edited(one.partition(PARTS)[0], other)


@pytest.mark.parametrize(
    "made",
    [
        "MADE = partial(moved, far={0})",
        "MADE = jax.jit(partial(moved, far={0}))",
        "MADE = bytes([{0}])",
        "MADE = {{'first': moved, 'second': range({0})}}",
        "def maker(far):\n    def made(x):\n        return x + far\n    return made\nMADE = maker({0})",
        "FAR = {0}\nMADE = partial(moved, far=FAR)",
        "MADE = {{}}\nMADE['only'] = (jax.numpy.sin, jax.numpy.cos)[{0} - 1]",
        "if UNUSED:\n    MADE = [jax.numpy.sin, {0}]",
        "from jax.numpy import log{0}p as MADE",
        "import math{0} as MADE",
        "from its_helpers import ONE as MADE",
        "from its_helpers import *\nMADE = partial(moved, far=ONE)",
        "MADE = its_helpers.ONE",
        "MADE = its_helpers.OTHER",
        "def MADE():\n    from its_helpers import ONE",
    ],
)
def test_what_makes_an_object_is_part_of_it_and_records_of_older_releases_lack_it(
    found: Found, monkeypatch: pytest.MonkeyPatch, made: str
) -> None:
    for number, name in enumerate(("log1p", "log2p")):
        monkeypatch.setattr(f"jax.numpy.{name}", (jax.numpy.sin, jax.numpy.cos)[number], raising=False)
        monkeypatch.setitem(sys.modules, f"math{1 + number}", (math, cmath)[number])

    def hashed(value: str) -> str:
        method = METHOD.replace("moved(x, RATE)", "moved(x, MADE)") + made.format(value)
        other = "@dataclass(frozen=True)\nclass Other:\n    def more(self):\n        return"
        helpers = f"{HELPERS}\n{other} {value}\n\nONE = bytes([{value}])\nOTHER = Other()\n"
        return found(method=method, helpers=helpers)["its_method.Own"]

    one, same, other = map(hashed, "112")
    assert one == same != other
    assert is_edited(one, other)
    older = one.rpartition(PARTS)[0].rstrip(PARTS)
    assert older
    assert not is_edited(older, other)


def test_what_a_base_that_is_no_dataclass_says_is_part_of_it(found: Found) -> None:
    method = METHOD.replace("Own(CmaEs):", "Own(Mixin, CmaEs):").replace("UNUSED", "class Mixin:\n    far: int")
    one, other = (found("far: int = 1", f"far: int = {far}", method=method)["its_method.Own"] for far in (2, 3))
    assert one != other


def test_the_last_bits_of_an_array_are_no_edit(found: Found) -> None:
    tables = ("jax.numpy.array([0.1, 0.3, 0.0])", "jax.numpy.array([0.1, 0.3 + 3e-8, -1e-17])")
    one, other = (found("RATE = 0.5", f"RATE = {table}") for table in tables)
    assert one == other


def test_the_base_of_a_part_is_part_of_it(found: Found) -> None:
    before, after = found(), found("return 2 * x", "return x + x")
    assert before["its_helpers.Part"] != after["its_helpers.Part"]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ('"""Climbs."""', '"""Climbs up."""'),
        ('        """Take a step."""\n', ""),
        ("  # up", ""),
        ("y = moved(x, RATE)", "y = moved(\n            x, RATE\n        )"),
        ("revision: ClassVar[int] = 1", "revision: ClassVar[int] = 2"),
        ("spread: float = 0.5", "spread: float = 0.25"),
        ("width: int = 3", "width: int = 4"),
        ("UNUSED = 1", "UNUSED = 2"),
        ("def unused(x):\n    return x", "def unused(x):\n    return -x"),
    ],
)
def test_words_layout_what_ids_hold_and_what_is_not_used_change_nothing(found: Found, old: str, new: str) -> None:
    assert found() == found(old, new)


def test_a_hash_is_the_same_under_every_release_of_python(found: Found) -> None:
    quoted = "y = moved(x, RATE) if f\"{', '.join(x)} {x!r:>{RATE}}\" else None"
    # Computed with Python 3.11 and 3.13, where it is tested, too. Since 3.12 `ast.unparse` writes other quotes here.
    assert found("y = moved(x, RATE)", quoted)["its_method.Own"] == "7f89fd0b35fd9fb8"


@pytest.mark.parametrize("folder", ["target", "site-packages", "lib/python3/dist-packages"])
def test_installed_code_has_no_hash_wherever_it_is(
    folder: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    elsewhere = tmp_path / folder
    elsewhere.mkdir(parents=True)
    (elsewhere / "its_package.py").write_text(HELPERS, encoding="utf-8")
    if folder == "target":  # of pip install --target
        (elsewhere / "its_package-1.dist-info").mkdir()
    monkeypatch.syspath_prepend(str(elsewhere))
    try:
        assert code_of(importlib.import_module("its_package").Part()) == {}
    finally:
        sys.modules.pop("its_package")


def test_code_of_this_package_has_no_hash_since_trials_record_its_version() -> None:
    assert code_of(HandBuilt(), NParity(3)) == {}


@pytest.mark.parametrize("name", ["trained", "Trainer.alone", "Trainer.train"])
def test_the_function_of_a_training_loop_is_looked_at(found: Found, name: str) -> None:
    def loop(module: Any) -> TrainingLoop:
        return TrainingLoop(reduce(getattr, name.split("."), module), packages=())

    before, after = found(make=loop), found("RATE}", "2 * RATE}", make=loop)
    assert list(before) == list(after) == [f"its_method.{name.partition('.')[0]}"]
    assert before != after


def test_a_training_loop_that_only_its_own_processes_import_is_looked_at_as_a_text(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(str(tmp_path))
    hashes = []
    for text in ("import torch\nRATE = 1", "import torch  # no edit\n\nRATE = 1", "import torch\nRATE = 2"):
        (tmp_path / "its_far_loops.py").write_text(text, encoding="utf-8")
        importlib.invalidate_caches()
        hashes.append(code_of(TrainingLoop("its_far_loops:train", packages=()), NParity(2)))
        source_code._TEXTS.clear()
    assert [list(one) for one in hashes] == [["its_far_loops"]] * 3
    assert hashes[0] == hashes[1] != hashes[2]
    assert code_of(TrainingLoop("json.tool:main", packages=()), TrainingLoop("nowhere:train", packages=())) == {}
