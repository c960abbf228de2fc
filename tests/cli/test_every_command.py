"""What every command does alike: a wrong option, store or project is one sentence, before anything is written."""

from __future__ import annotations

import argparse
from pathlib import Path

import pytest
from tiny_project import FILES, REPRODUCTION, Evoclaims

from evoclaims.cli.arguments import parser
from evoclaims.cli.store_folder import BEGINNING

ARGUMENTS = {
    "submit": ("--dry-run", "--cluster=local"),
    "champion": ("right", "--on=parity"),
    "look": ("parity",),
    "reproduce": ("all",),
    "merge": ("claims",),
    "across": ("--package", "pebble", "1.0"),
    "bisect": ("a", "--package=pebble", "--good=1", "--bad=2", "--releases=1"),
    "tables": ("page.md",),
}
"""What commands need; others need nothing."""
(CHOSEN,) = (action for action in parser()._actions if isinstance(action, argparse._SubParsersAction))
COMMANDS = {name: command for name, command in CHOSEN.choices.items() if name != "new"}
OF_STORES = {"verify", "merge"}
"""Commands that need no project."""
UNSEEN = {"look", "reproduce", "compare", "tables"}
"""Commands that have nothing to do here, and say so first."""


def asked(evoclaims: Evoclaims, command: str, *options: str) -> str:
    """Return the sentence with which a command refuses."""
    status, out, err = evoclaims(command, *ARGUMENTS.get(command, ()), *options)
    assert (status, err.count("\n")) == (2, 1), (command, options, out, err)
    assert err.startswith("evoclaims: ")
    assert {path.name for path in Path().iterdir()} <= FILES | {"page.md", ".cache"}, (command, options)
    return err


@pytest.mark.parametrize(
    ("option", "said", "without"),
    [
        ("--tier=ful", "There is no tier named 'ful'. Did you mean 'full'?", set()),
        ("--variant=trade", "There is no variant named 'trade'. Did you mean 'traded'?", set()),
        ("--device=tpu", "There is no device named 'tpu'. Did you mean 'gpu'?", set()),
        ("--numprocesses=0", "--numprocesses takes a number from 1 up, or auto", set()),
        ("--storage=pyproject.toml", "is a file, not a folder", UNSEEN),
        ("--storage=claims", "is not a trial store", UNSEEN),
        ("--storage=", "--storage names no folder", set()),
        ("--storage=mistyped", "the folder does not exist", set(BEGINNING)),
    ],
)
def test_an_option_that_means_nothing_is_a_sentence(
    evoclaims: Evoclaims, option: str, said: str, without: set[str]
) -> None:
    Path("page.md").write_text("<!-- evoclaims: verdicts -->\n<!-- evoclaims: end -->\n")
    name = option.partition("=")[0]
    taking = [one for one, command in COMMANDS.items() if name in command._option_string_actions and one not in without]
    assert len(taking) > 3
    assert {one: said in asked(evoclaims, one, option) for one in taking} == dict.fromkeys(taking, True)


def test_a_reproduction_that_does_not_import_is_a_sentence(evoclaims: Evoclaims) -> None:
    Path("tiny_paper.py").write_text(f"{REPRODUCTION}\ndef f(:\n")
    line = REPRODUCTION.count("\n") + 2
    said = "The module 'tiny_paper', which [tool.evoclaims] names, does not import: SyntaxError: invalid syntax"
    for command in COMMANDS.keys() - OF_STORES - {"across", "bisect"}:
        assert f"{said} (tiny_paper.py, line {line}).\n" in asked(evoclaims, command)


def test_outside_of_a_project_every_command_says_what_is_missing(
    evoclaims: Evoclaims, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    for command in COMMANDS.keys() - OF_STORES:
        assert "has a [tool.evoclaims] table" in asked(evoclaims, command)


@pytest.mark.parametrize(
    ("command", "suggested"),
    [
        ("reference", "run --tier smoke"),
        ("export", "run"),
        ("jobs", "submit"),
        ("status --variant=traded", "run --variant traded --tier smoke"),
        ("champion right --on=parity", "run right --on parity --tier smoke --trials 1 --first-seed 0"),
        ("mutants --stored", "mutants"),
    ],
)
def test_a_suggested_command_takes_the_store_that_was_named(evoclaims: Evoclaims, command: str, suggested: str) -> None:
    Path("my trials").mkdir()
    _, out, err = evoclaims(*command.split(), "--storage=my trials")
    assert f"`evoclaims {suggested} --storage 'my trials'`" in out + err
    assert ("`pytest -m smoke --claims-storage='my trials'`" in err) == command.startswith("mutants")
