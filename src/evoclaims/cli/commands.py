"""The commands of `evoclaims` and their options as Markdown, from the parser."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from evoclaims.cli.arguments import parser
from evoclaims.report.markdown_text import literal, table


def reference() -> str:
    """Return a list of all commands, and a section for each with its usage and its options."""
    commands = _commands(parser())
    index = table(("command", "purpose"), ((f"[`{name}`](#{name})", literal(says)) for name, says, _ in commands))
    return "\n\n".join([index, *(_section(name, command) for name, _, command in commands)])


def _commands(whole: argparse.ArgumentParser) -> list[tuple[str, str, argparse.ArgumentParser]]:
    """Return name, help and parser of each command, in the order of `evoclaims --help`."""
    (chosen,) = (action for action in whole._actions if isinstance(action, argparse._SubParsersAction))
    return [(str(one.dest), str(one.help), chosen.choices[one.dest]) for one in chosen._choices_actions]


def _section(name: str, command: argparse.ArgumentParser) -> str:
    """Return what there is to know about one command."""
    says = literal(_sentence(str(command.description)))
    return f"## {name}\n\n{says}\n\n{table(('argument', 'meaning'), _rows(command))}"


def _rows(command: argparse.ArgumentParser) -> Iterator[tuple[str, str]]:
    """Yield each argument of a command as it is written, and its meaning."""
    for action in command._actions:
        if not isinstance(action, argparse._HelpAction):
            yield f"`{_written(action)}`", literal(str(action.help))


def _written(action: argparse.Action) -> str:
    """Return an argument as it is written, such as "--tier TIER"."""
    value = action.metavar or action.dest.upper()
    values = " ".join(value) if isinstance(value, tuple) else value
    if not action.option_strings:
        return f"[{values}]" if action.nargs in ("?", "*") and "[" not in values else values
    if action.nargs == 0:
        return action.option_strings[0]
    if action.nargs == "?":
        values = f"[{values}]"
    elif action.nargs == "+" and not isinstance(value, tuple):
        values = f"{values} …"
    return f"{action.option_strings[0]} {values}"


def _sentence(text: str) -> str:
    """Return a text that begins with a capital letter and ends with a full stop."""
    return f"{text[:1].upper()}{text[1:]}".removesuffix(".") + "."
