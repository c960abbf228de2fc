"""Commands and options in the documents are ones that the command line and the plugin take."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from evoclaims.cli.arguments import parser

ROOT = Path(__file__).parents[2]
PAGES = (ROOT / "README.md", *(ROOT / "docs").glob("*.md"))
DOCUMENTS = {path.name: path.read_text(encoding="utf-8") for path in PAGES}
OPTIONS = re.findall(r"^\| `(--claims-.*?)` \|", DOCUMENTS["pytest.md"], re.MULTILINE)
NAMED = {"bisect", "merge", "champion"}
"""Commands that take more words, and that sentences call by their names."""


def _commands(text: str) -> set[str]:
    """Return the commands of a document, in blocks and in sentences."""
    shell = "\n".join(re.findall(r"```sh\n(.*?)```", text, re.DOTALL))
    found = [*re.findall(r"^evoclaims (.*)$", shell, re.MULTILINE), *re.findall(r"`evoclaims ([a-z][^`]*)`", text)]
    return {command.partition("#")[0].partition("&&")[0].strip() for command in found}


@pytest.mark.parametrize("name", sorted(DOCUMENTS.keys() - {"commands.md"}))  # which the parser writes itself
def test_each_command_is_one_that_the_command_line_takes(name: str) -> None:
    for command in sorted(_commands(DOCUMENTS[name])):
        words = shlex.split(command)
        if len(words) > 1 or words[0] not in NAMED:
            assert parser().parse_args(words).command == words[0], command


def test_each_option_of_pytest_is_one_that_the_plugin_takes(pytestconfig: pytest.Config) -> None:
    for option in OPTIONS:
        _, unknown = pytestconfig._parser.parse_known_and_unknown_args(shlex.split(option))
        assert unknown == []


def test_each_option_of_the_plugin_is_in_the_table(pytestconfig: pytest.Config) -> None:
    named = {re.split("[ =]", option)[0] for option in OPTIONS}
    plugin = (ROOT / "src" / "evoclaims" / "plugin" / "options.py").read_text(encoding="utf-8")
    assert named == set(re.findall(r"--claims-[\w-]+", plugin))
