"""A reproduction, a figure or a claim file with a mistake in it: a sentence with file and line, wherever it is met."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from tiny_project import REPRODUCTION, claims

from evoclaims.cli import main

Sentence = Callable[[pytest.RunResult, str], None]

MISTAKES = [
    ("def f(:\n", "SyntaxError: invalid syntax (tiny_paper.py, line {line})."),
    (
        "import a_package_that_is_not_installed\n",
        "ModuleNotFoundError: No module named 'a_package_that_is_not_installed' (tiny_paper.py, line {line}).",
    ),
    ("x = 1 / 0\n", "ZeroDivisionError: division by zero (tiny_paper.py, line {line})."),
    ("raise SystemExit(3)\n", "SystemExit: 3 (tiny_paper.py, line {line})."),
]


def _spoil(project: Any, text: str) -> int:
    """Put a mistake at the end of the reproduction; return its line."""
    (project.path / "tiny_paper.py").write_text(f"{REPRODUCTION}\n{text}")
    return REPRODUCTION.count("\n") + 2


@pytest.mark.parametrize(("text", "said"), MISTAKES)
def test_a_reproduction_that_does_not_import_is_a_sentence(
    project: Any, sentence: Sentence, text: str, said: str
) -> None:
    project.write(a="supported")
    line = _spoil(project, text)
    result = project.run("--claims-stored", own_store=True)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    sentence(
        result, "The module 'tiny_paper', which [tool.evoclaims] names, does not import: " + said.format(line=line)
    )


def test_a_figure_that_does_not_import_is_a_sentence(project: Any, capsys: pytest.CaptureFixture[str]) -> None:
    _spoil(project, "REPRODUCTION = replace(REPRODUCTION, figures=('fig1',))\n")
    Path("fig1.py").write_text("\nimport a_package_that_is_not_installed\n")
    assert main(["reproduce", "fig1"]) == 2
    assert capsys.readouterr().err == (
        "evoclaims: The module 'fig1', which the reproduction 'tiny' names, does not import: ModuleNotFoundError: "
        "No module named 'a_package_that_is_not_installed' (fig1.py, line 2).\n"
    )


CLAIM_FILES = [
    ("test_more.py", "import pytest\n\nimport a_package_that_is_not_installed\n", "(claims/test_more.py, line 3)"),
    ("test_more.py", "def f(:\n", "SyntaxError: invalid syntax (claims/test_more.py, line 1)"),
    ("test_more.py", "raise SystemExit(3)\n", "SystemExit: 3 (claims/test_more.py, line 1)"),
    ("test_more.py", "import pytest\npytest.exit('no')\n", "Exit: no (claims/test_more.py, line 2)"),
    (
        "test_more.py",
        "from evoclaims import claim\n\n@claim('b', says='x', where='', smoke='y')\ndef test_b(trials): ...\n",
        "The claim b lacks its where (claims/test_more.py, line 3)",
    ),
    (
        "test_more.py",
        "from evoclaims import claim\n\n@claim('b', says='x', where='x', smoke='y')\ndef test_b(): ...\n",
        "claims/test_more.py::test_b is a claim but takes neither the fixture `trials` nor `verdict`",
    ),
    (
        "test_more.py",
        "import pytest\n\n@pytest.mark.parametrize('x', [1])\ndef test_b(): ...\n",
        "test_b: function uses no argument 'x'",
    ),
    ("conftest.py", "\nimport a_package_that_is_not_installed\n", "(claims/conftest.py, line 2)"),
    (
        "conftest.py",
        "def pytest_collection_modifyitems(items):\n    raise ValueError('no order')\n",
        "ValueError: no order (claims/conftest.py, line 2)",
    ),
]


@pytest.mark.parametrize(("name", "text", "said"), CLAIM_FILES)
def test_claims_that_do_not_import_are_one_line_on_the_command_line(
    project: Any, capfd: pytest.CaptureFixture[str], name: str, text: str, said: str
) -> None:
    project.write(a="supported")
    (project.path / "claims" / name).write_text(text)
    capfd.readouterr()
    assert main(["status"]) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith(f"evoclaims: The claims in {project.path / 'claims'} cannot be collected: ")
    assert f"claims/{name}" in err
    assert err.endswith(f"{said}.\n")


def test_of_several_files_that_do_not_import_the_first_is_told_and_the_rest_counted(
    project: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in ("a", "b", "c"):
        (project.path / "claims" / f"test_{name}.py").write_text("def f(:\n")
    assert main(["status"]) == 2
    err = capsys.readouterr().err
    assert err.endswith("SyntaxError: invalid syntax (claims/test_a.py, line 1), and 2 more such errors.\n")


def test_a_plugin_that_does_not_import_is_one_line(project: Any, capsys: pytest.CaptureFixture[str]) -> None:
    project.write(a="supported")
    pyproject = project.path / "pyproject.toml"
    pyproject.write_text(pyproject.read_text().replace('addopts = "', 'addopts = "-p a_plugin_that_is_not_there '))
    assert main(["status"]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "a_plugin_that_is_not_there" in err


def test_a_claim_file_imports_modules_of_the_project_as_it_does_for_the_commands(project: Any) -> None:
    project.write(a="supported")
    (project.path / "our_words.py").write_text("SAID = 1\n")
    (project.path / "claims" / "test_imports.py").write_text(
        "from our_words import SAID\n\n\ndef test_it():\n    assert SAID\n"
    )
    result = project.run("claims/test_imports.py", own_store=True)
    result.assert_outcomes(passed=1)


@pytest.mark.parametrize(("collected", "options"), [((), ()), (("a",), ("-n1",))])
def test_a_claim_whose_file_does_not_import_is_not_called_unknown(
    project: Any, collected: tuple[str, ...], options: tuple[str, ...]
) -> None:
    project.write(**dict.fromkeys(collected, "supported"))
    Path("claims/test_others.py").write_text("import a_package_that_is_not_installed\n")
    result = project.run("--claims-only=H4", *options)
    shown = "\n".join([*result.outlines, *result.errlines])
    assert "ERROR collecting claims/test_others.py" in shown
    assert "no claim named 'H4' in the files that were collected. Other files were not collected; the" in shown


def test_claims_of_another_project_are_refused(project: Any, sentence: Any) -> None:
    """They would be judged by this project's trials."""
    project.write(a="supported")
    other = project.path / "other"
    (other / "claims").mkdir(parents=True)
    shutil.copy(project.path / "pyproject.toml", other)
    (other / "claims" / "test_others.py").write_text(claims(z="supported"))
    assert project.run("claims").ret == 0
    result = project.run("claims", "other/claims")
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    sentence(result, f"is a claim of the project {other}, and this run judges by {project.path}. Run each project's")
