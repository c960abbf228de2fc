"""What the kernels' README says is so."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

from evoclaims import kernels
from evoclaims.kernels.emit import llvm_ir

FOLDER = Path(llvm_ir.__file__).parents[1]
README = (FOLDER / "README.md").read_text(encoding="utf-8")


def test_every_file_is_explained_and_no_other() -> None:
    files = {path.relative_to(FOLDER).as_posix() for path in FOLDER.rglob("*.py") if path.name != "__init__.py"}
    assert set(re.findall(r"^\| `([\w/]+\.py)` \|", README, re.MULTILINE)) == files


def test_every_public_name_is_explained_and_no_other() -> None:
    assert set(re.findall(r"^\| `(\w+)` \|", README, re.MULTILINE)) == set(kernels.__all__)


def test_the_example_prints_a_kernel(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    (tmp_path / "example.py").write_text(code)
    runpy.run_path(str(tmp_path / "example.py"))
    printed = capsys.readouterr().out
    assert "define ptr @handler(ptr %frame)" in printed
    assert printed.count("@llvm.masked.scatter.v8f32.v8p0(<8 x float>") == 2  # declared, and called once


def test_the_limit_of_operations_is_the_one_that_is_checked() -> None:
    assert f"{llvm_ir.LARGEST:,} operations" in README.replace("\n", " ")
