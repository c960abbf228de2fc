"""The project around the current folder as commands use it: its settings, reproduction, trials and verdicts."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Final

from evoclaims.claims.as_published import AsPublished
from evoclaims.claims.collect import collect, judge_all
from evoclaims.claims.collected import Collected, Recorder, never
from evoclaims.claims.fetching import StoredOnly
from evoclaims.claims.session import Session
from evoclaims.cli.store_folder import open_store
from evoclaims.core.errors import UnknownNameError
from evoclaims.paper.archive import Archive
from evoclaims.paper.config import SuiteConfig, find_root, load_config, load_reproduction
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials import devices
from evoclaims.trials.store import Store
from evoclaims.verdicts.claim_report import ClaimReport

ALL_TIERS: Final = "all"


@dataclass(frozen=True)
class Project:
    """A project, and the folder of the store that a command was given, relative to the current one."""

    config: SuiteConfig
    reproduction: Reproduction
    storage: str

    @cached_property
    def store(self) -> Store:
        """The store.

        Raises:
            UserError: when something else is there.
        """
        return open_store(self.storage)

    @cached_property
    def archive(self) -> Archive:
        """The trials of the store, found even if a claim test changes the folder, and the reference trials."""
        store, reproduction = Store(self.store.root.absolute()), self.reproduction
        return Archive(store, reproduction.references, reproduction.imported)

    def tiers(self, name: str) -> tuple[str, ...]:
        """Return the tiers called `name`: one of them, or "all".

        Raises:
            UnknownNameError: when there is no such tier.
        """
        known = tuple(self.reproduction.tiers)
        if name not in (*known, ALL_TIERS):
            raise UnknownNameError("tier", name, (*known, ALL_TIERS))
        return known if name == ALL_TIERS else (name,)

    def judge(self, *tiers: str) -> list[ClaimReport]:
        """Judge all claims of some tiers; see `judge_variants`."""
        return [report for reports in self.judge_variants([(tier, "") for tier in tiers]) for report in reports]

    def judge_variants(self, asked: Sequence[tuple[str, str]]) -> list[list[ClaimReport]]:
        """Judge all claims for each tier and variant of the protocol ("" for itself), and run nothing.

        Verdicts come from stored trials, and from committed reference trials where those are missing.

        Raises:
            UserError: when the claims cannot be collected, or not all of them are judged.
        """
        sessions = {variant: self.session(variant) for _, variant in asked}
        return self.judge_sessions([(sessions[variant], tier) for tier, variant in asked])

    def judge_sessions(self, asked: Sequence[tuple[Session, str]]) -> list[list[ClaimReport]]:
        """Judge all claims of a tier in each session; raises as `judge_variants` does.

        A session that reads trials judges a claim during its call; others judge what has been collected.
        """
        readers = {id(session): session for session, _ in asked if session.only_reads}
        tiers = {key: list(dict.fromkeys(tier for one, tier in asked if id(one) == key)) for key in readers}
        asking = [(self._recorder(one.variant, one), tiers[key]) for key, one in readers.items()]
        found = dict(zip(readers, collect(self.config, asking) if asking else (), strict=True))
        judged = {(key, tier): _of_tier(found[key], tier) for key in readers for tier in tiers[key]}
        for (key, tier), claims in judged.items():
            self._collected.setdefault((readers[key].variant, tier), claims)
        return [
            judge_all(
                session, judged.get((id(session), tier)) or self.collect([(session.variant, tier)])[0], self.config.root
            )
            for session, tier in asked
        ]

    def collect(self, asked: Sequence[tuple[str, str]]) -> list[list[Collected]]:
        """Return all claims for each variant of the protocol ("" for itself) and tier; each test is called once.

        Raises:
            UserError: when the claims cannot be collected, or not all of them are called.
        """
        missing = [one for one in dict.fromkeys(asked) if one not in self._collected]
        if missing:
            tiers = {variant: [tier for of, tier in missing if of == variant] for variant, _ in missing}
            asking = [(self._recorder(variant), tiers[variant]) for variant in tiers]
            for variant, found in zip(tiers, collect(self.config, asking), strict=True):
                self._collected.update(((variant, tier), _of_tier(found, tier)) for tier in tiers[variant])
        return [self._collected[one] for one in asked]

    def _recorder(self, variant: str, reader: Session | None = None) -> Recorder:
        fetch = reader.fetch if reader else never
        return Recorder(self.reproduction, self.store, fetch, variant=variant, reader=reader)

    @cached_property
    def _collected(self) -> dict[tuple[str, str], list[Collected]]:
        return {}

    def as_published(self, tier: str) -> Session:
        """Return a session in which the paper's own numbers stand for trials."""
        return Session(self.reproduction, self.store, AsPublished(self.reproduction, tier))

    def session(self, variant: str = "") -> Session:
        """Return what claims are judged with: the trials at hand, under the protocol or a variant of it."""
        fetch = StoredOnly(self.archive)
        fetch.check()
        return Session(self.reproduction, self.archive.store, fetch, variant=variant)


def _of_tier(claims: Iterable[Collected], tier: str) -> list[Collected]:
    return [one for one in claims if one.test.tier == tier]


def open_project(storage: str) -> Project:
    """Return the project that the current folder lies in, with the store in the folder `storage`."""
    devices.configure()
    config = load_config(find_root(Path.cwd()))
    return Project(config, load_reproduction(config), storage)
