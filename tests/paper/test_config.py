"""Finding a project: each way of getting it wrong is one sentence."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from evoclaims.core.errors import UserError
from evoclaims.judging.design import Design
from evoclaims.paper.config import SuiteConfig, find_root, load_config, load_reproduction
from evoclaims.paper.reproduction import Reproduction, Tier

TABLE = '[tool.evoclaims]\nreproduction = "a_tiny_paper"\n'
MODULE = """
from pathlib import Path
from evoclaims.judging.design import Design
from evoclaims.paper.reproduction import Reproduction, Tier
REPRODUCTION = Reproduction("tiny", "A Tiny Paper", Path(__file__).parent, {"smoke": Tier({}, Design.fixed(3))})
"""


@pytest.fixture
def project(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder whose modules are forgotten at the end."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield tmp_path
    for name in [name for name in sys.modules if name.startswith("a_tiny_paper")]:
        del sys.modules[name]


def _sentence(caught: pytest.ExceptionInfo[UserError]) -> str:
    text = str(caught.value)
    assert "\n" not in text
    assert text.endswith(".")
    return text


def test_the_project_is_found_from_any_folder_within(project: Path) -> None:
    (project / "pyproject.toml").write_text(TABLE)
    (project / "a" / "b").mkdir(parents=True)
    (project / "a" / "pyproject.toml").write_text("[tool.other]\n")
    assert find_root(project / "a" / "b") == project


def test_a_folder_outside_of_any_project_says_what_to_add(project: Path) -> None:
    with pytest.raises(UserError, match=r"\[tool\.evoclaims\]") as caught:
        find_root(project)
    assert str(project) in _sentence(caught)


@pytest.mark.parametrize("text", ["", "[tool.evoclaims]\n", TABLE + "claim = 'x'\n", "[tool]\nevoclaims = 3\n"])
def test_a_table_that_is_missing_or_has_other_keys_says_which_it_takes(project: Path, text: str) -> None:
    (project / "pyproject.toml").write_text(text)
    with pytest.raises(UserError, match=r'reproduction = "package\.module".*no other keys') as caught:
        load_config(project)
    assert str(project / "pyproject.toml") in _sentence(caught)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('reproducton = "a_tiny_paper"\n', "has the unknown key 'reproducton'. Did you mean 'reproduction'? Known: cl"),
        (TABLE + "claim = 'x'\n", "has the unknown key 'claim'. Did you mean 'claims'?"),
        ("reproduction = 3\n", "has reproduction = 3, which is not text."),
        (TABLE + 'claims = ["a"]\n', "has claims = ['a'], which is not text."),
        (TABLE + "time_limit = 2\n", 'has time_limit = 2, which is not text. Write it in quotes, as time_limit = "…".'),
        (TABLE + "slurm = 3\n", "has slurm = 3, which is not a table."),
    ],
)
def test_the_wrong_key_is_named_first(project: Path, text: str, said: str) -> None:
    (project / "pyproject.toml").write_text(text if TABLE in text else f"[tool.evoclaims]\n{text}")
    with pytest.raises(UserError) as caught:
        load_config(project)
    assert _sentence(caught).startswith(f"[tool.evoclaims] {said}")


def test_a_pyproject_that_is_not_toml_is_named(project: Path) -> None:
    (project / "pyproject.toml").write_text("[tool\n")
    with pytest.raises(UserError, match="Cannot read .*pyproject"):
        find_root(project)


def test_claims_lie_in_the_folder_claims_unless_said_otherwise(project: Path) -> None:
    (project / "pyproject.toml").write_text(TABLE)
    assert load_config(project) == SuiteConfig(project, "a_tiny_paper", "claims")
    (project / "pyproject.toml").write_text(TABLE + 'claims = "elsewhere"\n')
    assert load_config(project).claims == "elsewhere"


def test_a_reproduction_is_imported_from_the_project(project: Path) -> None:
    (project / "a_tiny_paper.py").write_text(MODULE)
    found = load_reproduction(SuiteConfig(project, "a_tiny_paper"))
    assert (found.name, found.references) == ("tiny", project / "reference")


@pytest.mark.parametrize("name", ["a_tiny_paper_of_others", "a_tiny_paper_of_others.part"])
def test_a_module_that_is_not_there_is_a_sentence(project: Path, name: str) -> None:
    with pytest.raises(UserError, match=f"There is no module '{name}'") as caught:
        load_reproduction(SuiteConfig(project, name))
    _sentence(caught)


def test_a_file_in_the_place_of_a_module_is_told_the_module(project: Path) -> None:
    (project / "a_tiny_paper_in_a_file.py").write_text(MODULE)
    with pytest.raises(UserError, match=r"'a_tiny_paper_in_a_file' is no package: write 'a_tiny_paper_in_a_file'\."):
        load_reproduction(SuiteConfig(project, "a_tiny_paper_in_a_file.py"))


@pytest.mark.parametrize(
    ("name", "meant"), [("a_tiny_paper.our_papr", "a_tiny_paper.our_paper"), ("a_tiny_papr.our_paper", "a_tiny_paper")]
)
def test_a_misspelled_module_is_told_the_one_that_it_resembles(project: Path, name: str, meant: str) -> None:
    (project / "a_tiny_paper").mkdir()
    (project / "a_tiny_paper" / "__init__.py").touch()
    (project / "a_tiny_paper" / "our_paper.py").touch()
    with pytest.raises(
        UserError, match=f"no module '{name}' in .* names. Did you mean '{meant}'. Known: {meant}."
    ) as caught:
        load_reproduction(SuiteConfig(project, name))
    _sentence(caught)


def test_a_module_without_a_reproduction_is_a_sentence(project: Path) -> None:
    (project / "a_tiny_paper.py").write_text("REPRODUCTION = 'later'\n")
    with pytest.raises(UserError, match="has no REPRODUCTION") as caught:
        load_reproduction(SuiteConfig(project, "a_tiny_paper"))
    _sentence(caught)


@pytest.mark.parametrize(
    ("text", "said", "line"),
    [
        ("import a_package_that_is_not_installed\n", "ModuleNotFoundError: No module named 'a_package", 1),
        ("x = 1\n\nimport a_tiny\n", "ModuleNotFoundError: No module named 'a_tiny'", 3),
        ("from json import nothing\n", "ImportError: cannot import name 'nothing'", 1),
        ("x = 1\ndef f(:\n    pass\n", "SyntaxError: invalid syntax", 2),
        ("if True:\nx = 1\n", "IndentationError: expected an indented block", 2),
        ("# coding: nonsense\n", "SyntaxError: ", None),
        ("x = 1 / 0\n", "ZeroDivisionError: division by zero", 1),
        ("import sys\nsys.exit(3)\n", "SystemExit: 3", 2),
        ("\nimport json\njson.loads('{')\n", "JSONDecodeError: Expecting property name", 3),
        ("raise ValueError('first line\\nsecond line')\n", "ValueError: first line (", 1),
        ("class E(Exception):\n    __str__ = 3\nraise E\n", "E (", 3),
        (
            "from evoclaims.core.errors import UserError\n\ndef a():\n    raise UserError('Take three.')\na()\n",
            "does not import: Take three (",
            4,
        ),
        ("from evoclaims.judging.design import Design\nP = Design.fixed(0)\n", "does not import: A look takes", 2),
    ],
)
def test_a_module_that_does_not_import_is_a_sentence_with_file_and_line(
    project: Path, text: str, said: str, line: int | None
) -> None:
    (project / "a_tiny_paper.py").write_text(text)
    with pytest.raises(UserError) as caught:
        load_reproduction(SuiteConfig(project, "a_tiny_paper"))
    told = _sentence(caught)
    assert told.startswith("The module 'a_tiny_paper', which [tool.evoclaims] names, does not import: ")
    assert said in told
    assert told.endswith(f"(a_tiny_paper.py, line {line})." if line else "(a_tiny_paper.py).")


def test_a_file_that_cannot_be_compiled_without_a_line_is_named_by_its_module(project: Path) -> None:
    (project / "a_tiny_paper.py").write_bytes(b"x = 1\n\0\n")
    with pytest.raises(UserError, match="'a_tiny_paper'.*null bytes") as caught:
        load_reproduction(SuiteConfig(project, "a_tiny_paper"))
    _sentence(caught)


def test_the_line_is_the_innermost_one_of_the_project_and_not_of_what_it_calls(project: Path) -> None:
    (project / "a_tiny_paper_of_others").mkdir()
    (project / "a_tiny_paper_of_others" / "__init__.py").write_text("\nfrom a_tiny_paper_of_others import part\n")
    (project / "a_tiny_paper_of_others" / "part.py").write_text("import json\n\n\nx = json.loads('')\n")
    with pytest.raises(UserError) as caught:
        load_reproduction(SuiteConfig(project, "a_tiny_paper_of_others"))
    assert _sentence(caught).endswith("(a_tiny_paper_of_others/part.py, line 4).")


def test_an_interrupted_import_is_no_error_of_the_module(project: Path) -> None:
    (project / "a_tiny_paper.py").write_text("raise KeyboardInterrupt\n")
    with pytest.raises(KeyboardInterrupt):
        load_reproduction(SuiteConfig(project, "a_tiny_paper"))


@pytest.mark.parametrize(
    ("line", "option", "seconds"),
    [
        ("", None, 86_400.0),
        ('time_limit = "90min"\n', None, 5_400.0),
        ('time_limit = "90min"\n', "30s", 30.0),
        ("", "none", float("inf")),
    ],
)
def test_a_batch_may_take_what_the_option_says_or_else_the_table(
    project: Path, line: str, option: str | None, seconds: float
) -> None:
    (project / "pyproject.toml").write_text(TABLE + line)
    assert load_config(project).seconds(option) == seconds


def test_a_time_limit_that_is_no_time_is_a_sentence(project: Path) -> None:
    (project / "pyproject.toml").write_text(TABLE + 'time_limit = "soon"\n')
    with pytest.raises(UserError, match=r"pyproject.toml has time_limit = .* is a length of time") as caught:
        load_config(project).seconds(None)
    assert "'soon'" in _sentence(caught)


def test_a_reproduction_with_text_for_a_folder_or_a_number_for_a_design_is_refused() -> None:
    with pytest.raises(UserError, match=r"folder='\.'\. Write Path\(__file__\)\.parent"):
        Reproduction("tiny", "A Tiny Paper", ".", {})  # type: ignore[arg-type]
    with pytest.raises(
        UserError, match=r"A tier has design=10, which is not a Design\. Write Tier\(conditions, Design\.fixed\(10\)\)"
    ):
        Tier({}, 10)  # type: ignore[arg-type]
    for names in ("a_method", ("a_method",), ("a_method", 3)):
        with pytest.raises(UserError, match=r"A tier has a condition named .*\. Name a method and a task"):
            Tier({names: None}, Design.fixed(10))  # type: ignore[dict-item]
    with pytest.raises(UserError, match=r"A tier has None for a_method on a_task\. Write a Condition"):
        Tier({("a_method", "a_task"): None}, Design.fixed(10))  # type: ignore[dict-item]
