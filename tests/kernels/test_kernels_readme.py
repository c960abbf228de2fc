"""What the kernels' README says is so."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest

from evoclaims.kernels import ptx

FOLDER = Path(ptx.__file__).parent
README = (FOLDER / "README.md").read_text(encoding="utf-8")


def test_every_file_is_explained_and_no_other() -> None:
    files = {path.name for path in FOLDER.glob("*.py")} - {"__init__.py"}
    assert set(re.findall(r"^\| `(\w+\.py)` \|", README, re.MULTILINE)) == files


def test_the_example_prints_a_kernel(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    (tmp_path / "example.py").write_text(code)
    runpy.run_path(str(tmp_path / "example.py"))
    printed = capsys.readouterr().out
    assert printed.startswith(ptx.HEAD)
    assert printed.count("st.global.f32") == 1


def test_the_limit_of_operations_is_the_one_that_is_checked() -> None:
    assert f"{ptx.LARGEST:,} operations" in README.replace("\n", " ")
