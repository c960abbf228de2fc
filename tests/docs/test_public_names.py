"""The public names: each is documented, and the paper and the guides import nothing else."""

from __future__ import annotations

import ast
import importlib
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PACKAGES = (
    "evoclaims",
    "evoclaims.methods",
    "evoclaims.methods.neat",
    "evoclaims.methods.mechanisms",
    "evoclaims.networks",
    "evoclaims.envs",
    "evoclaims.figures",
    "evoclaims.mutants",
)
PYTHON = [
    path.relative_to(ROOT)
    for folder in ("claims", "reproductions", "src/evoclaims/projects")
    for path in sorted((ROOT / folder).rglob("*.py"))
]
INSIDE = {
    Path("reproductions/nisioti2025") / name
    for name in (
        "findings.py",
        "findings_pictures.py",
        "other_champions.py",
        "other_mazes.py",
        "other_ppo.py",
        "other_stones.py",
    )
}
"""Modules that change the inside of this package's own methods and tasks, as a user's project need not."""
GUIDES = [Path("README.md"), *(path.relative_to(ROOT) for path in sorted((ROOT / "docs").glob("*.md")))]


def documented() -> dict[str, list[str]]:
    """Return the names in the first column of each package's table."""
    sections = re.split(r"^## `(.*)`\n", (ROOT / "docs" / "api.md").read_text(encoding="utf-8"), flags=re.MULTILINE)
    rows = {package: re.findall(r"^\| (`.*?) \|", text, re.MULTILINE) for package, text in _pairs(sections[1:])}
    return {package: [name for row in found for name in re.findall(r"`(\w+)`", row)] for package, found in rows.items()}


def _pairs(parts: list[str]) -> Iterator[tuple[str, str]]:
    return zip(parts[::2], parts[1::2], strict=True)


def _imports(source: str) -> Iterator[tuple[str, str]]:
    """Return what some code imports of evoclaims: the module, and the name or nothing."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and str(node.module).partition(".")[0] == "evoclaims":
            yield from ((str(node.module), alias.name) for alias in node.names)
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names if alias.name.partition(".")[0] == "evoclaims")


@pytest.mark.parametrize("package", PACKAGES)
def test_every_public_name_is_there_and_is_documented(package: str) -> None:
    module = importlib.import_module(package)
    assert all(getattr(module, name) is not None for name in module.__all__)
    assert sorted(documented()[package]) == module.__all__
    assert set(module.__all__) <= set(dir(module))


def test_no_other_package_is_documented_as_public() -> None:
    assert tuple(documented()) == PACKAGES


def test_what_no_package_holds_is_an_error_that_says_so() -> None:
    with pytest.raises(ImportError, match="cannot import name 'Reproductoin' from 'evoclaims'"):
        exec("from evoclaims import Reproductoin")
    with pytest.raises(AttributeError, match=r"module 'evoclaims\.envs' has no attribute 'Parity'"):
        importlib.import_module("evoclaims.envs").Parity  # noqa: B018


@pytest.mark.parametrize("path", PYTHON, ids=str)
def test_the_paper_imports_public_names_alone(path: Path) -> None:
    public = {(package, name) for package, names in documented().items() for name in names}
    assert (set(_imports((ROOT / path).read_text(encoding="utf-8"))) <= public) == (path not in INSIDE)


@pytest.mark.parametrize("path", GUIDES, ids=str)
def test_the_guides_show_public_names_alone(path: Path) -> None:
    public = {(package, name) for package, names in documented().items() for name in names}
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / path).read_text(encoding="utf-8"), flags=re.DOTALL)
    assert {found for block in blocks for found in _imports(block)} <= public
