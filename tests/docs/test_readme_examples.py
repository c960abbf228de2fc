"""The examples of README: what it shows is what the project has and takes."""

from __future__ import annotations

import importlib
import re
import shlex
import shutil
from pathlib import Path

import pytest

from evoclaims.cli.arguments import parser
from evoclaims.core.errors import UserError
from evoclaims.envs import Robot
from evoclaims.envs.ecorobot.robots import SIMPLE_ROB

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
PYTHON = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
SHELL = "\n".join(re.findall(r"```sh\n(.*?)```", README, re.DOTALL))
COMMANDS = [*re.findall(r"^evoclaims (.*)$", SHELL, re.MULTILINE), *re.findall(r"`evoclaims ([a-z][^`]*)`", README)]


@pytest.mark.parametrize("command", sorted({command.partition("#")[0].strip() for command in COMMANDS}))
def test_each_command_is_one_that_the_command_line_takes(command: str) -> None:
    words = shlex.split(command)
    assert parser().parse_args(words).command == words[0]


def test_each_option_of_pytest_is_one_that_the_plugin_takes(pytestconfig: pytest.Config) -> None:
    options = re.findall(r"^\| `(--claims-.*?)` \|", README, re.MULTILINE)
    assert len(options) > 10
    for option in options:
        _, unknown = pytestconfig._parser.parse_known_and_unknown_args(shlex.split(option))
        assert unknown == []


def test_the_claim_that_is_shown_is_a_claim_of_the_paper() -> None:
    (shown,) = (text for text in PYTHON if "@claim" in text)
    claims = [path.read_text(encoding="utf-8") for path in (ROOT / "claims").glob("*.py")]
    assert any(shown.strip() in text for text in claims)


def test_the_robot_and_the_task_that_are_shown_are_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    package = tmp_path / "my_package"
    package.mkdir()
    (package / "__init__.py").write_text("")
    shutil.copy(SIMPLE_ROB.file, package / "rover.xml")
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "slalom.py").write_text("\n".join(text for text in PYTHON if "@claim" not in text))
    slalom = importlib.import_module("slalom").slalom
    assert slalom.robot.file == str(package / "rover.xml")
    assert slalom.scene.model.nu == slalom.action_size > 0


@pytest.mark.parametrize(
    ("xml", "said"),
    [
        ("my_robots:rover.xml", "there is no package 'my_robots': write PACKAGE:PATH"),
        ("rover.xml", "there is no package 'rover.xml': write PACKAGE:PATH"),
        (":rover.xml", "there is no package '': write PACKAGE:PATH"),
        ("evoclaims:rover.xml", "there is no file "),
    ],
)
def test_a_model_that_is_not_there_is_a_sentence(xml: str, said: str) -> None:
    with pytest.raises(UserError, match="The robot 'rover' has its model in ") as error:
        _ = Robot("rover", xml).file
    assert said in str(error.value)
