"""The project around the current folder: its reproduction, and its claims judged from the store."""

from __future__ import annotations

from pathlib import Path

from evoclaims.cli.judging import judge
from evoclaims.paper.archive import Archive
from evoclaims.paper.config import SuiteConfig, find_root, load_config, load_reproduction
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials import devices
from evoclaims.trials.store import Store
from evoclaims.verdicts.claim_report import ClaimReport


def open_project() -> tuple[SuiteConfig, Reproduction]:
    """Return the settings and the reproduction of the project that the current folder lies in."""
    devices.configure()
    config = load_config(find_root(Path.cwd()))
    return config, load_reproduction(config)


def open_store(name: str) -> Store:
    """Return the store in the folder `name`, relative to the current one.

    Raises:
        UserError: when that is there and is no store.
    """
    store = Store(Path(name))
    store.check()
    return store


def open_archive(storage: str, reproduction: Reproduction) -> Archive:
    """Return the trials of the store in the folder `storage`, and the reproduction's reference trials."""
    return Archive(open_store(storage), reproduction.references)


def judge_stored(config: SuiteConfig, storage: str, tier: str, variant: str = "") -> list[ClaimReport]:
    """Judge a tier's claims from stored trials, and committed reference trials where those are missing; run nothing.

    Raises:
        UserError: when the claims cannot be collected, or not all of them are judged.
    """
    options = (
        "--claims-stored",
        "--claims-committed",
        # the project's own store may not be there yet, which of a folder that is named would be a mistake
        *([f"--claims-storage={Path(storage).absolute()}"] if Path(storage).exists() else []),
        f"--claims-variant={variant}",
    )
    return judge(config.root / config.claims, config.root, tier, options)
