"""`evoclaims across`: the same claims with several releases of a package, files of pins, or Pythons."""

from __future__ import annotations

import argparse
import itertools
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from evoclaims.cli.elsewhere import opened, released
from evoclaims.cli.terminal import REPORT, styled, write
from evoclaims.core.environments import Recipe, checked, checked_name, installed_here
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.report import across as across_report
from evoclaims.report.console import PlainSpokenConsole
from evoclaims.verdicts import export
from evoclaims.verdicts.across import Across, across

FORMS: Final[Mapping[str, Callable[[Across], bytes]]] = {
    "markdown": lambda found: across_report.markdown(found, _command()).encode(),
    "csv": lambda found: export.as_csv(across_report.rows(found)),
    "json": lambda found: export.as_json(across_report.rows(found)),
}
"""Writers by the names of their forms."""


def main(options: argparse.Namespace) -> int:
    """Judge in every environment and print the table; 1 when something changed, broke or was not judged."""
    if options.form is not None and options.form not in FORMS:
        raise UnknownNameError("form", options.form, FORMS)
    recipes = _recipes(options)
    if len(recipes) == 1 and len((options.package or ())[1:]) > 1:
        print(f"All of these are {recipes[0].label}: there is nothing to compare.")
        return 0
    elsewhere = opened(options, options.only)
    found = across([elsewhere.judge(recipe) for recipe in recipes])
    if not found.claims:
        raise UserError("No claim was judged in any of these environments; the reasons are above.")
    across_report.keep(found, elsewhere.store.root, datetime.now(UTC).isoformat(" ", "minutes"), _command())
    console = PlainSpokenConsole(file=styled())
    for part in across_report.terminal(found, console.width):
        console.print()
        console.print(part)
    print(f"\n{across_report.LEGEND}")
    for line in (*found.lines, *_unused(found, options.package), across_report.headline(found)):
        print(line)
    if options.form is not None:
        out = Path(options.out or REPORT / f"across.{'md' if options.form == 'markdown' else options.form}")
        write(out, FORMS[options.form](found), ours=options.out is None)
        print(f"wrote {out}")
    return int(bool(found.changed or found.without_verdicts or found.broken or not found.judged))


def _command() -> str:
    return shlex.join(["evoclaims", *sys.argv[1:]])


def _recipes(options: argparse.Namespace) -> list[Recipe]:
    """Return every combination of releases, Pythons and files of pins, each once.

    Raises:
        UserError: when none is named, or one cannot be.
    """
    package, named = "", list(options.package or ())
    if named:
        package = checked_name(named.pop(0))
    if package and not named:
        raise UserError(f"--package {package} has no version. Add some, such as --package {package} installed newest.")
    if not (named or options.constraints or options.python):
        raise UserError(
            "No difference between environments is named. Add --package NAME VERSION ..., --constraints "
            "FILE ... or --python 3.13."
        )
    if "" in (options.python or ()):
        raise UserError("'' is not a version of Python. Write one such as 3.13.")
    versions = [_version(package, word) for word in named] or [""]
    pins: list[Path | None] = [Path(name) for name in options.constraints or ()] or [None]
    found = itertools.product(versions, options.python or [""], pins)
    recipes = list(dict.fromkeys(Recipe(package, version, python, file) for version, python, file in found))
    labels = [recipe.label for recipe in recipes]
    if alike := sorted({label for label in labels if labels.count(label) > 1}):
        raise UserError(
            f"Several environments would be called {alike[0]}. Give the files of constraints different names."
        )
    return recipes


def _version(package: str, word: str) -> str:
    """Return the version that a word names: installed, newest, or one itself."""
    if word == "newest":
        return released(package)[-1]
    if word != "installed":
        return checked(word)
    here = installed_here()
    if package not in here:
        raise UserError(f"{package} is not installed here, so it has no installed version. Name a version.")
    return here[package]


def _unused(found: Across, package: Sequence[str] | None) -> list[str]:
    """Return a line when no trial depends on the package, so that its releases could change no trial.

    Of claims without trials, or with errors, nobody knows on what these would depend.
    """
    reports = (report for one in found.environments for report in one.reports.values())
    known = not found.broken and any(report.sources for report in reports)
    if not package or not known or any(one.depends_on(package[0]) for one in found.environments):
        return []
    return [f"No trial of these claims depends on {package[0]}: its releases can only change how they are judged."]
