"""A claim's accepted verdicts by date, with what changed behind each: library versions, device, the rules."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from evoclaims.core.errors import UnknownNameError, UserError
from evoclaims.core.printable import printable
from evoclaims.verdicts.acceptance import changes
from evoclaims.verdicts.history import AcceptedVerdict, History, eras, in_order

SHORT = 12
"""Digits of a hash that are shown."""


def timeline(history: History, claim: str = "") -> str:
    """Return the entries of a claim ("G1", or one case of it, "G1[n_parity]"), or of all claims, one per line.

    Raises:
        UserError: when nothing has been accepted yet.
        UnknownNameError: when the claim has no accepted verdict.
    """
    return "\n".join(line for key in chosen(history, claim) for line in _claim(*key, history[key]))


def chosen(history: History, claim: str) -> list[tuple[str, str]]:
    """Return the keys of a claim, or of one case of it, or of all claims, in order; raises as `timeline` does."""
    if not history:
        raise UserError("No verdict has been accepted yet: run `evoclaims accept` to accept the current ones.")
    found = [key for key in sorted(history, key=in_order) if claim in ("", key[1], key[1].partition("[")[0])]
    if not found:
        raise UnknownNameError("accepted claim", claim, {name for _, name in history})
    return found


def _claim(tier: str, claim: str, entries: Sequence[AcceptedVerdict]) -> Iterator[str]:
    """Yield the lines of one claim."""
    yield f"{printable(claim)} ({printable(tier)})"
    before: AcceptedVerdict | None = None
    for era in eras(entries):
        if before is not None:
            yield (
                "  a new history: what is judged has changed "
                f"(fingerprint {before.fingerprint[:SHORT]} -> {era[0].fingerprint[:SHORT]})"
            )
        for entry in era:
            yield f"  {described(before, entry)}"
            before = entry


def described(before: AcceptedVerdict | None, entry: AcceptedVerdict) -> str:
    """Return an entry in one line, with what has changed since the entry before."""
    why = entry.reason.removesuffix(f" at n = {entry.n}")
    behind = _first(entry) if before is None else _changes(before, entry)
    return printable(f"{entry.accepted}  {entry.outcome} (n = {entry.n}: {why}){behind and '  '}{behind}")


def _first(entry: AcceptedVerdict) -> str:
    """Return versions and device of the first verdict's trials."""
    made_by = [f"{name} {entry.versions[name]}" for name in ("python", "jax") if name in entry.versions]
    return ", ".join([*made_by, *filter(None, [entry.device])])


def _changes(before: AcceptedVerdict, entry: AcceptedVerdict) -> str:
    """Return what differs from the entry before."""
    moved = changes(before, entry)
    if before.revision != entry.revision:
        moved.append(f"revision {before.short_revision(SHORT)} -> {entry.short_revision(SHORT)}")
    return ", ".join(moved)
