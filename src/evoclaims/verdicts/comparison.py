"""The two sides of a comparison: accepted verdicts with the reference trials, or verdicts and trials of a store."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath

from evoclaims.core.packages import Versions, depends_on
from evoclaims.judging.drift_report import DigestCheck, DriftReport
from evoclaims.paper import references
from evoclaims.paper.archive import Archive, Name, names_of
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials.result import TrialResult
from evoclaims.trials.store import DamagedFileError
from evoclaims.verdicts import history, transitions
from evoclaims.verdicts.claim_report import ClaimReport
from evoclaims.verdicts.other_code import edits, listed
from evoclaims.verdicts.source_trials import found_in, moved
from evoclaims.verdicts.transitions import Standings

Trials = Mapping[str, Sequence[TrialResult]]
"""Trials by condition, named like its file of reference trials: "smoke/cma_es-n_parity"."""


@dataclass(frozen=True)
class Side:
    """One side of a comparison.

    Attributes:
        name: in words, such as "the store old".
        verdicts: by tier and claim.
        trials: by condition.
        troubles: a line for each file that could not be read, and for code that was edited after its trials had run.
        reads: what claims read of each trial, by condition, where that is known.
        methods: by condition, below its tier and variant, for a store. Conditions of one method are tested jointly.
    """

    name: str
    verdicts: Standings
    trials: Trials
    troubles: tuple[str, ...] = ()
    reads: Mapping[str, frozenset[str]] = field(default_factory=dict)
    methods: Mapping[str, PurePosixPath] = field(default_factory=dict)

    def of(self, tiers: Iterable[str]) -> Side:
        """Return the part of this side that belongs to some tiers."""
        kept = set(tiers)
        return replace(
            self,
            verdicts={key: standing for key, standing in self.verdicts.items() if key[0] in kept},
            trials={name: trials for name, trials in self.trials.items() if _tier_of(name) in kept},
        )


def committed(reproduction: Reproduction) -> Side:
    """Return the accepted verdicts and the reference trials in the reproduction's folder.

    Raises:
        UserError: when one of the files is damaged.
    """
    top = reproduction.references
    trials = {_named(path.relative_to(top)): references.load(path) for path in sorted(top.rglob("*.jsonl"))}
    accepted = transitions.accepted(history.load(reproduction.folder / history.FILE))
    return Side("accepted verdicts, and reference trials", accepted, trials)


def store(reproduction: Reproduction, archive: Archive, reports: Iterable[ClaimReport]) -> Side:
    """Return the verdicts from a store, and those of its trials that are judged.

    Args:
        reproduction: only trials of its conditions are used.
        archive: the store, and what else the verdicts come from; trials that are judged from there are left out.
        reports: verdicts judged from `archive`.
    """
    names, damaged, reports = names_of(reproduction), list[DamagedFileError](), list(reports)
    trials: dict[str, list[TrialResult]] = defaultdict(list)
    methods: dict[str, PurePosixPath] = {}
    versions = {
        condition: reproduction.tier(known[0].tier, known[0].variant).condition(known[0].method, known[0].task).versions
        for condition, known in names.items()
    }
    seeds = {condition: _seeds(reproduction, known) for condition, known in names.items()}
    records = archive.store.results(damaged)
    # A pilot's trials, or those of `watch`, may be many and older: they would hide what the judged ones have become.
    found = {record.id: record.condition for record in records if record.seed in seeds.get(record.condition, ())}
    for trial in _judged(archive, {trial: versions[condition] for trial, condition in found.items()}):
        for name in names[trial.condition]:
            folder = reproduction.references_of(name.variant)
            path = references.path_of(folder, name.tier, name.method, name.task).relative_to(reproduction.references)
            trials[_named(path)].append(trial)
            methods[_named(path)] = PurePosixPath(path.parent, name.method)
    troubles = (*(f"not read: {error}" for error in damaged), *edits(reports))
    reads: dict[str, set[str]] = defaultdict(set)
    for report in reports:
        for source in report.sources:
            path = references.path_of(
                reproduction.references_of(report.variant), report.tier, source.method, source.task
            )
            reads[_named(path.relative_to(reproduction.references))].update(source.reads)
    known = {name: frozenset(those) for name, those in reads.items()}
    return Side(f"the store {archive.store.root}", transitions.standings(reports), trials, troubles, known, methods)


def _seeds(reproduction: Reproduction, names: Iterable[Name]) -> frozenset[int]:
    """Return the seeds of a condition's trials that a verdict or the drift check may look at."""
    tiers = [(reproduction.tier(name.tier), name) for name in names]
    looks = (seed for tier, _ in tiers for seed in tier.design.seeds(tier.design.with_third_look().last.n))
    return frozenset((*looks, *(seed for tier, name in tiers for seed in tier.seeds_for_drift(name.method, name.task))))


def _judged(archive: Archive, trials: Mapping[str, Versions]) -> Iterator[TrialResult]:
    """Yield the store's records of trials that are judged, given the installed versions of what each depends on.

    A trial with a damaged record is not judged.
    """
    for trial, versions in trials.items():
        with suppress(DamagedFileError):
            if (record := archive.stored(trial, versions)) is not None:
                yield record


def compare_trials(old: Side, new: Side) -> tuple[DriftReport, DigestCheck]:
    """Check the conditions that both sides have for drift, and CPU trials for bit-identical results.

    The new side is a store's: a file's name, such as "my-a-parity", does not say where the method ends.
    """
    both = sorted(name for name in old.trials.keys() & new.trials.keys() if new.trials[name])
    return references.compare(
        [
            references.paired(
                name,
                new.trials[name],
                old.trials[name],
                method=str(new.methods[name]),
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


def _tier_of(name: str) -> str:
    """Return the tier of a condition's name; a task's own name may have slashes, such as "ALE/Pong-v5"."""
    folders = PurePosixPath(name).parts
    return folders[2] if folders[0] == "variants" else folders[0]


def _named(path: PurePosixPath | Path) -> str:
    return path.with_suffix("").as_posix()
