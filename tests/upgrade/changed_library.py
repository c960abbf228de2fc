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
        package: the library's name.
        folder: its own folder, from where libraries are installed.
        file: where the constant is in that folder.
        after: a text that comes before it.
        old, new: the first text after that, and what takes its place.
        condition: the condition of the small laboratory that depends on the library.
    """

    package: str
    folder: str
    file: str
    after: str
    old: str
    new: str
    condition: str


CHANGES: Final = (
    Change(
        "evosax", "evosax", "algorithms/distribution_based/cma_es.py", "Params(", "(1.0)", "(1e-6)", "cma_es on parity"
    ),
    Change("brax", "brax", "training/agents/ppo/losses.py", "v_loss = jnp.mean(", "0.5", "0.4", "ppo on parity"),
    Change("optax", "optax", "_src/alias.py", "\ndef adam(", "= 0.999", "= 0.99", "ppo on parity"),
    Change(
        "qdax",
        "qdax",
        "core/emitters/mutation_operators.py",
        "line_noise = ",
        "* line_sigma",
        "* line_sigma * 0.5",
        "map_elites on plane",
    ),
    Change("mujoco-mjx", "mujoco/mjx", "_src/math.py", "def axis_angle_to_quat(", "* 0.5", "* 0.4", "random on swing"),
)


def next_version(package: str) -> str:
    """Return a version that comes after the installed one."""
    return f"{importlib.metadata.version(package)}.post99"


def install_changed(change: Change, site: Path) -> None:
    """Lay the changed library out in `site` as an installer does: its files, and what says its name and version."""
    installed = Path(str(importlib.metadata.distribution(change.package).locate_file("")))
    left_out = shutil.ignore_patterns("test_data", "testdata", "*_test.py")  # what is compiled stays as new as its text
    shutil.copytree(installed / change.folder, site / change.folder, ignore=left_out)
    for shared in list(Path(change.folder).parents)[:-1]:  # of another library, which stays as it is
        for entry in (installed / shared).iterdir():
            if entry.name != "__pycache__" and not (site / shared / entry.name).exists():
                (site / shared / entry.name).symlink_to(entry)
    file = site / change.folder / change.file
    before, found, rest = file.read_text().partition(change.after)
    assert found
    assert change.old in rest
    file.write_text(before + found + rest.replace(change.old, change.new, 1))
    version = next_version(change.package)
    information = site / f"{change.package.replace('-', '_')}-{version}.dist-info"
    information.mkdir()
    (information / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {change.package}\nVersion: {version}\n")
