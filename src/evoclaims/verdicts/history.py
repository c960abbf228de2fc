"""The history of accepted verdicts: `verdicts.toml` beside a reproduction, written by machine."""

from __future__ import annotations

import dataclasses
import itertools
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from datetime import date
from pathlib import Path
from typing import Annotated, Any, Final

import tomli_w
from msgspec import Meta, ValidationError, convert

from evoclaims.core.canonical import content_hash
from evoclaims.core.errors import UserError
from evoclaims.core.files import read_file
from evoclaims.core.printable import printable
from evoclaims.judging.verdict import Outcome
from evoclaims.verdicts.claim_report import ClaimReport, EarlierRun

SCHEMA: Final = 1
FILE: Final = "verdicts.toml"
_MEND: Final = "Restore the file from version control; `evoclaims accept` goes on with it."


@dataclass(frozen=True)
class AcceptedVerdict:
    """An accepted verdict.

    Attributes:
        outcome: as judged: supported, refuted or inconclusive.
        reason: why, in a sentence.
        n: number of judged trials per side.
        p: of the whole assertion; None if nothing was tested.
        fingerprint: hash of everything fixed beforehand.
        accepted: when (ISO 8601 date).
        versions: of the packages that the trials were made with, by name; several are joined by commas.
        device: kind of device that made the trials; several are joined by commas.
        revision: git revision that made them, with "-dirty" where files differed; several are joined by commas.
        trials: hash of the digests of all trials behind the verdict.
    """

    outcome: Outcome
    reason: str
    n: int
    p: Annotated[float, Meta(ge=0, le=1)] | None
    fingerprint: str
    accepted: str
    versions: Mapping[str, str]
    device: str
    revision: str
    trials: str

    def short_revision(self, digits: int) -> str:
        """Return the revisions with shortened hashes."""
        parts = (revision.partition("-") for revision in self.revision.split(", "))
        return ", ".join(sha[:digits] + dash + state for sha, dash, state in parts) or "unknown"


History = Mapping[tuple[str, str], tuple[AcceptedVerdict, ...]]
"""Accepted verdicts by tier and claim, such as ("full", "G1[n_parity]"); oldest first, so that the last one counts."""


def key_of(report: ClaimReport) -> tuple[str, str]:
    """Return the key of a claim's verdicts, without characters that a file cannot hold."""
    return report.tier, printable(report.name)


def in_order(key: tuple[str, str]) -> tuple[str, str, int, str, str]:
    """Return a sort key: by tier, then G9 before G10, and a claim before its cases."""
    tier, name = key
    claim, _, case = name.partition("[")
    return tier, claim[:1], len(claim), claim, case.removesuffix("]")


def ordered(reports: Iterable[ClaimReport]) -> list[ClaimReport]:
    """Return reports by tier, G9 before G10."""
    return sorted(reports, key=lambda report: in_order(key_of(report)))


def eras(entries: Sequence[AcceptedVerdict]) -> tuple[tuple[AcceptedVerdict, ...], ...]:
    """Split entries where the fingerprint changes: before that, something else was judged."""
    return tuple(tuple(group) for _, group in itertools.groupby(entries, key=lambda entry: entry.fingerprint))


def load(path: Path) -> History:
    """Read accepted verdicts; empty if there is no such file.

    Raises:
        UserError: when the file is damaged, of another schema, or has an invalid entry.
    """
    try:
        data = read_file(path)
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise UserError(f"Cannot read {path}: {error.strerror or error}.") from error
    return parse(data, str(path))


def parse(data: bytes, name: str) -> History:
    """Return the history in the text of a file called `name`; the inverse of `dump`.

    Raises:
        UserError: as `load` does.
    """
    try:
        plain = tomllib.loads(data.decode())
    except (ValueError, RecursionError) as error:
        raise _torn(name, f"it is no whole TOML file ({error})") from error
    if plain.get("schema") != SCHEMA or isinstance(plain["schema"], bool):
        raise _torn(name, f"its schema is {plain.get('schema')!r} and this version of evoclaims reads schema {SCHEMA}")
    environments, verdicts = (_table(plain.get(part, {}), name, part) for part in ("environments", "verdicts"))
    history: dict[tuple[str, str], tuple[AcceptedVerdict, ...]] = {}
    for tier, claims in verdicts.items():
        for claim, rows in _table(claims, name, tier).items():
            if not isinstance(rows, list) or not rows:
                raise _torn(name, f"{claim} ({tier}) has no list of verdicts")
            history[tier, claim] = tuple(_entry(row, environments, name, f"{claim} ({tier})") for row in rows)
    return history


def dump(history: History) -> str:
    """Return a history as TOML; entries with the same versions share one table, so that each is short."""
    environments: dict[str, dict[str, str]] = {}
    verdicts: dict[str, dict[str, list[dict[str, Any]]]] = {}
    for (tier, claim), entries in sorted(history.items()):
        rows = verdicts.setdefault(tier, {}).setdefault(claim, [])
        for entry in entries:
            versions = dict(sorted(entry.versions.items()))
            environment = content_hash(versions)[:12]
            environments[environment] = versions
            row = {**dataclasses.asdict(entry), "outcome": str(entry.outcome), "environment": environment}
            rows.append({name: value for name, value in row.items() if name != "versions" and value is not None})
    plain = {"schema": SCHEMA, "environments": dict(sorted(environments.items())), "verdicts": verdicts}
    return "# Written by `evoclaims accept`: verdicts as last accepted, oldest first.\n" + tomli_w.dumps(plain)


def _entry(row: object, environments: Mapping[str, Any], name: str, claim: str) -> AcceptedVerdict:
    plain = _table(row, name, claim)
    expected = {field.name for field in fields(AcceptedVerdict)} - {"versions"} | {"environment"}
    if plain.keys() | {"p"} != expected:
        strange = ", ".join(sorted((plain.keys() | {"p"}) ^ expected))
        raise _torn(name, f"{claim} lacks these entries, or has them beyond the known ones: {strange}")
    environment = str(plain["environment"])
    if environment not in environments:
        raise _torn(name, f"{claim} names the environment {environment}, which is not among the environments")
    try:
        convert(plain["accepted"], date)
        return convert({"p": None, **plain, "versions": environments[environment]}, AcceptedVerdict)
    except ValidationError as error:
        problem, _, path = str(error).partition(" - at `$")
        raise _torn(name, f"{path.strip('.`') or 'accepted'} of {claim} is not as it was written: {problem}") from error


def _table(value: object, name: str, part: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise _torn(name, f"{part} is no table")
    return value


def _torn(name: str, reason: str) -> UserError:
    return UserError(f"{name} holds no accepted verdicts: {reason}. {_MEND}")


def following(report: ClaimReport, last: ClaimReport | None) -> ClaimReport:
    """Return the report of a claim's newest run with the runs before it, of which `last` was the newest."""
    if last is None:
        return report
    known = (*last.earlier, EarlierRun(last.outcome, last.reason, last.p))
    own = report.earlier[len(known) :] if report.earlier[: len(known)] == known else report.earlier
    return replace(report, earlier=(*known, *own))


def last_runs(reports: Iterable[ClaimReport]) -> list[ClaimReport]:
    """Return one report for each claim and tier: of its last run, with the others in `earlier`.

    A report that comes twice is of one run: pytest makes several reports of a test.
    """
    last: dict[tuple[str, str], ClaimReport] = {}
    seen = set[str]()
    for report in reports:
        key, content = key_of(report), repr(report)  # as text: NaN is not equal to itself
        if content not in seen:
            seen.add(content)
            last[key] = following(report, last.get(key))
    return list(last.values())


def changed_by_repetition(report: ClaimReport) -> str:
    """Return a line about a claim whose runs ended differently; empty where they agree, or there is one."""
    outcomes = dict.fromkeys([*(run.outcome for run in report.earlier), report.outcome])
    if len(outcomes) < 2:
        return ""
    ends = " -> ".join([*(run.outcome for run in report.earlier), report.outcome])
    return f"{report.name} ({report.tier}) ran {len(report.earlier) + 1} times, {ends}: the last run counts"
