"""A changed copy of an installed library with a version of its own, put where Python finds it first."""

from __future__ import annotations

import importlib.metadata
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Final


@dataclass(frozen=True)
class Change:
    """One constant of a library, changed.

    Attributes:
        package: the library's name, and that of its folder.
        file: where the constant is in that folder.
        after: a text that comes before it.
        old, new: the first text after that, and what takes its place.
        condition: the condition of the small laboratory that depends on the library.
    """

    package: str
    file: str
    after: str
    old: str
    new: str
    condition: str


CHANGES: Final = (
    Change("evosax", "algorithms/distribution_based/cma_es.py", "Params(", "(1.0)", "(1e-6)", "cma_es on parity"),
    Change("brax", "training/agents/ppo/losses.py", "v_loss = jnp.mean(", "0.5", "0.4", "ppo on parity"),
    Change("optax", "_src/alias.py", "\ndef adam(", "= 0.999", "= 0.99", "ppo on parity"),
)


def next_version(package: str) -> str:
    """Return a version that comes after the installed one."""
    return f"{importlib.metadata.version(package)}.post99"


def install_changed(change: Change, site: Path) -> None:
    """Lay the changed library out in `site` as an installer does: its files, and what says its name and version."""
    installed = Path(str(importlib.metadata.distribution(change.package).locate_file("")))
    left_out = shutil.ignore_patterns("test_data", "testdata", "*_test.py")  # what is compiled stays as new as its text
    shutil.copytree(installed / change.package, site / change.package, ignore=left_out)
    file = site / change.package / change.file
    before, found, rest = file.read_text().partition(change.after)
    assert found
    assert change.old in rest
    file.write_text(before + found + rest.replace(change.old, change.new, 1))
    version = next_version(change.package)
    information = site / f"{change.package}-{version}.dist-info"
    information.mkdir()
    (information / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {change.package}\nVersion: {version}\n")
