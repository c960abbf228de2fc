"""What claims can say: every measure and every kind of assertion, as Markdown, from what their classes declare."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
import re
from collections.abc import Iterator
from typing import Any, Final

from evoclaims.judging import assertion, kinds
from evoclaims.judging.assertion import Assertion
from evoclaims.judging.measure import Measure, Profile
from evoclaims.paper.trial_group import TrialGroup
from evoclaims.report.formatting import literal, table

_READS: Final = {"Measure": "a number", "Event": "true or false", "Profile": "a number per level"}
"""What is read from each trial, by the class that a property returns."""

_OPERATORS: Final = {"__mul__": "{argument} * {owner}"}
"""How methods with names of Python's own are written."""

_SOURCES: Final = "../src/"


def assertions() -> str:
    """Return a section for each kind of assertion that the package has; those that join others come last."""
    found = sorted(declared_kinds(), key=lambda kind: (kind.__module__ == assertion.__name__, kind.kind))
    return "\n\n".join(map(_section, found))


def measures(trials: type[TrialGroup]) -> str:
    """Return a table of what claims read from trials, and one of a paper's own measures if it has any."""
    headings = ("in a claim", "reads from a trial", "what it is")
    rows = [*_rows(TrialGroup, "a"), *_rows(Profile, "a.success"), *_rows(Measure, "a.reward")]
    own = [row for kind in reversed(trials.__mro__) if not issubclass(TrialGroup, kind) for row in _rows(kind, "a")]
    blocks = [table(headings, rows)]
    if own:
        blocks += [f"This paper's own (`{trials.__name__}`):", table(headings, own)]
    return "\n\n".join(blocks)


def declared_kinds() -> Iterator[type[Assertion]]:
    """Yield the kinds of assertion with an entry: one module each, and the compounds."""
    modules = [
        importlib.import_module(f"{kinds.__name__}.{found.name}") for found in pkgutil.iter_modules(kinds.__path__)
    ]
    for module in (*modules, assertion):
        for value in vars(module).values():
            declared = isinstance(value, type) and issubclass(value, Assertion) and vars(value).get("entry")
            if declared and value.__module__ == module.__name__:
                yield value


def _section(kind: type[Assertion]) -> str:
    entry, file = kind.entry, kind.__module__.replace(".", "/") + ".py"
    assert entry is not None
    return "\n\n".join(
        (
            f"### {literal(kind.kind)}",
            "\n".join(("```python", *(f"verdict({written})" for written in entry.syntax), "```")),
            (inspect.getdoc(kind) or "").partition("\n\n")[0],
            "\n".join(
                (
                    f"* Null hypothesis: {literal(entry.null)}",
                    f"* Supported: {literal(entry.supported)}",
                    f"* Refuted: {literal(entry.refuted)}",
                    f"* Source: {literal(entry.source)} ([{file.rpartition('/')[2]}]({_SOURCES}{file}))",
                )
            ),
        )
    )


def _rows(kind: type[Any], owner: str) -> Iterator[tuple[str, str, str]]:
    """Yield a row for each property and method of a class itself that returns something to read from trials."""
    for name, value in vars(kind).items():
        function = value.fget if isinstance(value, property) else value
        if not inspect.isfunction(function) or (name.startswith("_") and name not in _OPERATORS):
            continue
        signature = inspect.signature(function)
        returned = signature.return_annotation
        arguments = [str(one.replace(annotation=one.empty)) for one in list(signature.parameters.values())[1:]]
        reads = _READS.get(str(getattr(returned, "__name__", returned)))
        if reads is None and not (isinstance(value, property) and returned is signature.empty):
            continue
        if name in _OPERATORS:
            written = _OPERATORS[name].format(owner=owner, argument=arguments[0])
        else:
            written = f"{owner}.{name}" if isinstance(value, property) else f"{owner}.{name}({', '.join(arguments)})"
        yield f"`{written}`", reads or "", _said(function).replace("|", "\\|")


def _said(documented: Any) -> str:
    """Return a docstring up to its sections, on one line."""
    text = re.split(r"\n\n(?:Args|Attributes|Raises|Returns):", inspect.getdoc(documented) or "")[0]
    return " ".join(text.split())
