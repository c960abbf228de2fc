"""The two sides of a comparison: verdicts and trials of a store, of a working tree, or of a git revision."""

from __future__ import annotations

import os
import re
import subprocess
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import Final

from evoclaims.core.errors import UserError
from evoclaims.core.packages import Versions, depends_on
from evoclaims.judging.drift_report import DriftReport
from evoclaims.judging.tripwire import DigestCheck
from evoclaims.paper import references
from evoclaims.paper.archive import Archive, names_of
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials.result import TrialResult
from evoclaims.trials.store import DamagedFileError
from evoclaims.verdicts import history, transitions
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.other_code import listed
from evoclaims.verdicts.source_trials import found_in, moved
from evoclaims.verdicts.transitions import Standings

GIT_SECONDS: Final = 60.0
"""How long one call of git may take."""


@dataclass(frozen=True)
class GitRevision:
    """A commit of the repository that contains a folder.

    Attributes:
        name: as the user wrote it.
        sha: the commit's full name.
        folder: paths are relative to it.
    """

    name: str
    sha: str
    folder: Path

    def read(self, path: str) -> bytes | None:
        """Return a file's content; None when the revision does not have it.

        Raises:
            UserError: when git fails.
        """
        return self._git("cat-file", "blob", f"{self.sha}:./{path}") if path in self.files(path) else None

    def files(self, path: str) -> tuple[str, ...]:
        """Return the files at and below a path, sorted.

        Raises:
            UserError: when git fails.
        """
        listed = self._git("ls-tree", "-r", "-z", "--name-only", self.sha, "--", path)
        return tuple(sorted(os.fsdecode(name) for name in listed.split(b"\0") if name))

    def _git(self, *arguments: str) -> bytes:
        done = run_git(self.folder, *arguments)
        if done.returncode:
            reason = " ".join(done.stderr.decode(errors="replace").split())
            raise UserError(f"git cannot read the revision {self.name}: {reason}.")
        return done.stdout


def find_revision(name: str, folder: Path) -> GitRevision | None:
    """Return the commit that a name means (a branch, a tag, HEAD~3, …), or None.

    Raises:
        UserError: when git is missing or too slow, or `folder` is not in a repository.
    """
    inside = run_git(folder, "rev-parse", "--is-inside-work-tree")
    if inside.returncode or inside.stdout.strip() != b"true":
        raise UserError(
            f"{folder} is not in a git repository, so there is no revision to compare with. Compare two "
            "stores instead, or `evoclaims compare` alone: current verdicts with accepted ones."
        )
    if not name or "\0" in name:
        return None
    # A name that begins with a dash must not be taken for an option; from here on only the commit's hash is used.
    found = run_git(folder, "rev-parse", "--verify", "--quiet", "--end-of-options", f"{name}^{{commit}}")
    sha = found.stdout.decode(errors="replace").strip()
    known = found.returncode == 0 and re.fullmatch(r"[0-9a-f]{40,64}", sha) is not None
    return GitRevision(name, sha, folder) if known else None


def run_git(folder: Path, *arguments: str) -> subprocess.CompletedProcess[bytes]:
    """Run a read-only git command in a folder, without a shell.

    Raises:
        UserError: when git is missing or too slow.
    """
    try:
        return subprocess.run(
            ["git", "-c", "core.fsmonitor=false", *arguments],
            cwd=folder,
            capture_output=True,
            stdin=subprocess.DEVNULL,
            timeout=GIT_SECONDS,
            check=False,
            env={**os.environ, "GIT_OPTIONAL_LOCKS": "0", "LC_ALL": "C"},
        )
    except OSError as error:
        raise UserError(f"Revisions are read by git, which does not start: {error.strerror or error}.") from error
    except subprocess.TimeoutExpired as error:
        raise UserError(f"git gave no answer within {GIT_SECONDS:g} seconds.") from error


Trials = Mapping[str, Sequence[TrialResult]]
"""Trials by condition, named like its file of reference trials: "smoke/cma_es-n_parity"."""


@dataclass(frozen=True)
class Side:
    """One side of a comparison.

    Attributes:
        name: in words, such as "the revision HEAD~3".
        verdicts: by tier and claim.
        trials: by condition.
        troubles: a line for each file that could not be read.
        reads: what claims read of each trial, by condition, where that is known.
    """

    name: str
    verdicts: Standings
    trials: Trials
    troubles: tuple[str, ...] = ()
    reads: Mapping[str, frozenset[str]] = field(default_factory=dict)

    def of(self, tiers: Iterable[str]) -> Side:
        """Return the part of this side that belongs to some tiers."""
        kept = set(tiers)
        return replace(
            self,
            verdicts={key: standing for key, standing in self.verdicts.items() if key[0] in kept},
            trials={name: trials for name, trials in self.trials.items() if PurePosixPath(name).parent.name in kept},
        )


def working_tree(reproduction: Reproduction) -> Side:
    """Return the accepted verdicts and the reference trials in the reproduction's folder.

    Raises:
        UserError: when one of the files is damaged.
    """
    top = reproduction.references
    trials = {_named(path.relative_to(top)): references.load(path) for path in sorted(top.rglob("*.jsonl"))}
    accepted = transitions.accepted(history.load(reproduction.folder / history.FILE))
    return Side("the working tree", accepted, trials)


def revision(reproduction: Reproduction, at: GitRevision) -> Side:
    """Return the accepted verdicts and the reference trials that are committed at a revision.

    Args:
        reproduction: the current one; only its folders are used.
        at: the revision, read in the reproduction's folder.

    Raises:
        UserError: when the revision has neither, or one of the files is damaged.
    """
    top = reproduction.references.relative_to(reproduction.folder).as_posix()
    verdicts = at.read(history.FILE)
    files = [path for path in at.files(top) if path.endswith(".jsonl")]
    if verdicts is None and not files:
        raise UserError(
            f"The revision {at.name} has neither {history.FILE} nor reference trials in {reproduction.folder}."
        )
    accepted = history.parse(verdicts, f"{history.FILE} at {at.name}") if verdicts is not None else {}
    trials = {
        _named(PurePosixPath(path).relative_to(top)): references.records(at.read(path) or b"", f"{path} at {at.name}")
        for path in files
    }
    return Side(f"the revision {at.name} ({at.sha[:12]})", transitions.accepted(accepted), trials)


def store(reproduction: Reproduction, archive: Archive, reports: Iterable[ClaimReport]) -> Side:
    """Return the verdicts from a store, and those of its trials that are judged.

    Args:
        reproduction: only trials of its conditions are used.
        archive: the store, and what else the verdicts come from; trials that are judged from there are left out.
        reports: verdicts judged from `archive`.
    """
    names, damaged, reports = names_of(reproduction), list[DamagedFileError](), list(reports)
    trials: dict[str, list[TrialResult]] = defaultdict(list)
    versions = {
        condition: reproduction.tier(known[0].tier, known[0].variant).condition(known[0].method, known[0].task).versions
        for condition, known in names.items()
    }
    found = {record.id: record.condition for record in archive.store.results(damaged) if record.condition in names}
    for trial in _judged(archive, {trial: versions[condition] for trial, condition in found.items()}):
        for name in names[trial.condition]:
            folder = reproduction.references_of(name.variant)
            path = references.path_of(folder, name.tier, name.method, name.task)
            trials[_named(path.relative_to(reproduction.references))].append(trial)
    troubles = tuple(f"not read: {error}" for error in damaged)
    reads: dict[str, set[str]] = defaultdict(set)
    for report in reports:
        for source in report.sources:
            path = references.path_of(
                reproduction.references_of(report.variant), report.tier, source.method, source.task
            )
            reads[_named(path.relative_to(reproduction.references))].update(source.reads)
    known = {name: frozenset(those) for name, those in reads.items()}
    return Side(f"the store {archive.store.root}", transitions.standings(reports), trials, troubles, known)


def _judged(archive: Archive, trials: Mapping[str, Versions]) -> Iterator[TrialResult]:
    """Yield the store's records of trials that are judged, given the installed versions of what each depends on.

    A trial with a damaged record is not judged.
    """
    for trial, versions in trials.items():
        with suppress(DamagedFileError):
            if (record := archive.stored(trial, versions)) is not None:
                yield record


def compare_trials(old: Side, new: Side) -> tuple[DriftReport, DigestCheck]:
    """Check the conditions that both sides have for drift, and CPU trials for bit-identical results."""
    both = sorted(name for name in old.trials.keys() & new.trials.keys() if new.trials[name])
    return references.compare(
        [
            references.paired(
                name,
                new.trials[name],
                old.trials[name],
                method=name.partition("-")[0],
                reads=new.reads.get(name, ()) or old.reads.get(name, ()),
            )
            for name in both
        ]
    )


def version_changes(old: Side, new: Side) -> list[str]:
    """Return which packages' versions differ between the trials of both sides, with the conditions, one line a change.

    Only packages that a condition depends on are looked at.
    """
    found: dict[str, list[str]] = defaultdict(list)
    for name in sorted(old.trials.keys() & new.trials.keys()):
        packages = tuple(sorted({one for trial in new.trials[name] for one in depends_on(trial.provenance) or ()}))
        change = moved(*(found_in(side.trials[name], packages) for side in (old, new)))
        if change:
            found[change].append(name)
    return [f"versions changed: {change}: {listed(names)}" for change, names in found.items()]


def _named(path: PurePosixPath | Path) -> str:
    """Return a condition's name from the path of its reference trials."""
    return path.with_suffix("").as_posix()
