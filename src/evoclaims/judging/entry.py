"""What the vocabulary says of a kind of assertion."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Entry:
    """A kind's entry in the vocabulary; each text is one or more sentences.

    Attributes:
        syntax: how it is written in a claim, where `a` and `b` are trials of a method on a task.
        null: what is rejected for the claim to be supported, or why nothing is.
        supported: when the claim is.
        refuted: when the claim is, or is smaller than claimed.
        source: where the test is published.
    """

    syntax: tuple[str, ...]
    null: str
    supported: str
    refuted: str
    source: str
