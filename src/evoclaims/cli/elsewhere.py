"""Claims judged in other environments: each is made, runs pytest in a process of its own, and gives its verdicts."""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from packaging.utils import canonicalize_name
from packaging.version import Version

from evoclaims.claims.claim_names import selected
from evoclaims.cli.project import open_project
from evoclaims.cli.store_folder import open_store
from evoclaims.cli.terminal import terminal
from evoclaims.core.environments import (
    Environment,
    NotInstallableError,
    Recipe,
    ending,
    folder_of,
    make,
    pip_here,
    reason,
)
from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.core.files import at_once, read_json
from evoclaims.core.printable import printable
from evoclaims.core.tiers import TIERS
from evoclaims.paper.config import find_root, load_config
from evoclaims.report.live_line import LiveLine, duration
from evoclaims.report.table_cells import totals
from evoclaims.trials.store import Store
from evoclaims.verdicts.across import Judged, judged
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.other_code import edited, listed
from evoclaims.verdicts.source_trials import in_words, versions_of

KEPT = "environments"
"""Folder of the environments, in the store."""

LOG = "pytest.log"
"""The output of the last run in an environment, in its folder."""


class NotJudgedError(Exception):
    """The claims could not be judged in an environment; the message is the reason, in one line."""


@dataclass(frozen=True)
class Elsewhere:
    """What is judged in every environment.

    Attributes:
        root: folder of the project.
        claims: folder of its claims.
        store: where trials and environments are kept.
        tier: "smoke" or "full".
        only: ids or names of claims, joined by commas; None for all.
        device: auto, cpu or gpu.
    """

    root: Path
    claims: Path
    store: Store
    tier: str
    only: str | None
    device: str

    def judge(self, recipe: Recipe) -> Judged:
        """Make an environment, or take the kept one, and judge the claims in it; say what is done meanwhile."""
        began, label, notes = time.monotonic(), printable(recipe.label), ""
        # The name of a record's file has no version of Python, so that another Python needs a store of its own.
        store = Store(self.store.root / f"python{recipe.python}") if recipe.python else self.store
        try:
            begins = partial(print, f"{label}: making its environment", flush=True)
            environment = make(recipe, self.store.root / KEPT, self.root, begins)
            moved = environment.moved(recipe.package) if recipe.is_layer else {}
            also = ", ".join(f"{name} {was or 'none'} -> {now}" for name, (was, now) in moved.items())
            notes = f"its installation changed {also}, too" if also else ""
            if recipe.is_layer and (folder := folder_of(recipe.package, recipe.version)):
                notes += f"{notes and '; '}it is what is installed here from {folder}, no release: "
                notes += "an edit without a new version is not seen"
            if notes:
                print(f"{label}: {notes}", flush=True)
            if below := environment.below(recipe.package, self.root):
                old = ", ".join(f"{name} {now} (oldest supported: {oldest})" for name, (now, oldest) in below.items())
                raise NotJudgedError(f"it has {old}; name a release that works with supported ones")
            log = os.path.relpath(environment.folder / LOG)
            print(f"{label}: judging claims; what pytest says is in {log}", flush=True)
            reports = self._run(environment, store)
        except (NotInstallableError, NotJudgedError) as error:
            print(f"{label}: {error}", flush=True)
            return Judged(recipe.label, {}, {}, trouble=str(error), notes=notes)
        print(f"{label}: {totals(reports)} in {duration(time.monotonic() - began)}", flush=True)
        return judged(recipe.label, reports, store, notes)

    def _run(self, environment: Environment, store: Store) -> list[ClaimReport]:
        """Run the claims in an environment and return their reports.

        Raises:
            NotJudgedError: when it has judged none.
        """
        try:
            with tempfile.TemporaryDirectory() as folder:  # another command may use the environment at the same time
                verdicts = Path(folder) / "verdicts.json"
                command = self._command(environment, store, verdicts)
                status, output = _watched(command, self.root, environment.folder / LOG)
                reports = _reports(verdicts)
        except BrokenPipeError:  # nobody reads what this command prints
            raise
        except OSError as error:  # a full disk
            raise NotJudgedError(f"pytest cannot be run there ({error})") from error
        if not reports or status not in (0, 1, 5):  # pytest's: all well, failures, and nothing measured
            raise NotJudgedError(f"pytest {ending(status)}{_last_words(status, output)}")
        if others := _of_other_versions(reports, environment):
            raise NotJudgedError(
                f"its claims were judged from trials of {others}, which is not what is installed there; "
                "leave --claims-any-version and --claims-stored out of PYTEST_ADDOPTS"
            )
        # Only some releases may have such trials: the edit would look like a change of the others, or hide one.
        if names := sorted({name for report in reports for name in edited(report)}):
            raise NotJudgedError(
                f"its claims were judged from trials that ran before {printable(listed(names))} was edited or renamed; "
                "raise its `revision`, so that they run again, or name another --storage"
            )
        return reports

    def _command(self, environment: Environment, store: Store, verdicts: Path) -> list[str]:
        claims = os.path.join(os.curdir, os.path.relpath(self.claims, self.root))  # as in `judging`
        return [
            *(str(environment.python), "-m", "pytest", claims, f"--rootdir={os.curdir}"),
            # Releases warn of different things, and the project's own options may need plugins that are not there.
            *("-pno:cacheprovider", "-Wdefault", "-oaddopts=", "-orequired_plugins="),
            "--maxfail=0",  # whatever PYTEST_ADDOPTS says: a claim left out would look like one that has not changed
            *(f"-m{self.tier}", f"--claims-device={self.device}"),
            *(f"--claims-storage={store.root.absolute()}", f"--claims-json={verdicts}"),
            *([] if self.only is None else [f"--claims-only={self.only}"]),
        ]


def _of_other_versions(reports: Sequence[ClaimReport], environment: Environment) -> str:
    """Return which versions that are not the environment's have made trials of claims, in words; empty if none has."""
    made_with = versions_of(source for report in reports for source in report.sources)
    here = {name: environment.versions.get(canonicalize_name(name)) for name in made_with}
    others = {name: those for name, those in made_with.items() if here[name] is not None and those != (here[name],)}
    return ", ".join(f"{name} {in_words(those)}" for name, those in others.items())


def _last_words(status: int, output: str) -> str:
    """Return the last lines of a process; where a signal killed it, the innermost function of a dump of its stack."""
    if status >= 0:
        return f": {printable(reason(output))}"
    _, _, stack = output.partition("(most recent call first):")
    frame = re.search(r'File "(?P<file>[^"]+)", line (?P<line>\d+) in (?P<name>\S+)', stack)
    if frame is None:
        return ""
    return printable(f" in {frame['name']} ({'/'.join(Path(frame['file']).parts[-3:])}, line {frame['line']})")


def _reports(verdicts: Path) -> list[ClaimReport]:
    """Return the reports that a run has written; none if there is no such file, or it is another evoclaims'."""
    try:
        return [ClaimReport.from_json(plain) for plain in read_json(verdicts)["claims"]]
    except (OSError, ValueError, KeyError, TypeError):
        return []


def _watched(command: list[str], folder: Path, log: Path) -> tuple[int, str]:
    """Run a command, write what it says to a file, and show the newest line on a terminal.

    Returns:
        Its exit status and its output.
    """
    write, columns = terminal()
    line_shown = LiveLine(write if columns else lambda _: None, columns)
    lines = []
    # Lines are wanted when they are written; the page of a step on GitHub is for the table, not for every environment.
    environment = {name: value for name, value in os.environ.items() if name != "GITHUB_STEP_SUMMARY"}
    with subprocess.Popen(
        command,
        cwd=folder,
        env={**environment, "PYTHONUNBUFFERED": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
    ) as process:
        try:
            with open(log, "w", encoding="utf-8", errors="backslashreplace", opener=at_once) as file:
                for line in process.stdout or ():
                    lines.append(line)
                    file.write(line)
                    file.flush()
                    line_shown.show(partial(printable, line.strip()))
        except BaseException:  # what it has stored stays, and checkpoints let the next call go on
            process.terminate()
            process.wait()
            raise
        finally:
            line_shown.close()
    return process.returncode, "".join(lines)


def opened(options: argparse.Namespace, only: str | None) -> Elsewhere:
    """Return what judges the claims of the project around the current folder, of which `only` names some.

    Raises:
        UserError: for an unknown tier or claim, without a project, or when the store cannot be written.
    """
    if options.tier not in TIERS:
        raise UnknownNameError("tier", options.tier, TIERS)
    config = load_config(find_root(Path.cwd()))
    store = open_store(options.storage)
    store.check_writable()
    if only is not None and (names := _claims(options)):  # before minutes are spent on an environment
        selected(only, names)
    return Elsewhere(config.root, config.root / config.claims, store, options.tier, only, options.device)


def _claims(options: argparse.Namespace) -> set[str]:
    """Return the ids and names of the project's claims; none where what is installed here cannot collect them."""
    try:
        project = open_project(options.storage)
        (claims,) = project.collect([("", options.tier)])
    except UserError:
        return set()
    return {name for one in claims for name in (one.test.claim.id, one.test.name)}


def released(package: str) -> list[str]:
    """Return all final releases that this Python can use.

    Raises:
        UserError: when pip finds none.
    """
    command = [sys.executable, *pip_here(), "index", "versions", package]
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
    listed = re.search(r"^Available versions: (.*)$", done.stdout, re.MULTILINE)
    if listed is None:
        why = reason(done.stdout + done.stderr)
        raise UserError(f"pip lists no releases of {package} ({why}). Name them on the command line.")
    return sorted(listed[1].split(", "), key=Version)


def between(first: str, last: str, releases: list[str]) -> list[str]:
    """Return releases from one to another, both included, in order.

    Raises:
        UserError: when the first is not older than the last.
    """
    low, high = Version(first), Version(last)
    if not low < high:
        raise UserError(f"{first} is not older than {last}. Name the older release first.")
    inner = sorted((one for one in releases if low < Version(one) < high), key=Version)
    return [first, *inner, last]
