"""The judge: follows the design's looks, checks attainable p first, and gives exactly one outcome."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Callable
from dataclasses import dataclass, replace

from evoclaims.core.canonical import content_hash
from evoclaims.judging.assertion import Assertion, Finding
from evoclaims.judging.design import Design, Look
from evoclaims.judging.exact import MAX_TRIALS
from evoclaims.judging.sample import Source, Trials, UnreadableTrialError
from evoclaims.judging.scrutiny import Copies, copies, overspent
from evoclaims.judging.verdict import OUT_OF_TIME, Direction, Outcome, PValues, Verdict
from evoclaims.trials.failed import place, why
from evoclaims.trials.result import TrialResult

JUDGING_REVISION = 2
"""Raised when what a kind's tests are about changes, so that old verdicts do not count as new ones.

Not for another test of the same hypotheses, α and margin: changed verdicts are then entered under their fingerprint,
such as those of 2026-11-26, when pairs of seeds gave way to all pairs (docs/judging.md lists them).
"""


def fingerprint(assertion: Assertion, design: Design, *, claim: str = "", tier: str = "") -> str:
    """Return the fingerprint of a claim, such as "G1", in a tier: 64 hexadecimal digits.

    It hashes the assertion's kind, measures and margins, with the ids of its conditions, and all of the design.
    """
    return content_hash(
        {
            "judging": JUDGING_REVISION,
            "claim": claim,
            "tier": tier,
            "assertion": assertion.plain(),
            "protocol": design,  # the key of every fingerprint committed so far
        }
    )


@dataclass(frozen=True)
class Ending:
    """The look at which judging ends, and what it has found.

    Attributes:
        outcome: of the assertion.
        look: the look, with as many trials as count.
        trials: those that count.
        finding: what they say; None where trials crashed or cannot be read.
        note: why judging ended without a decision or before it, if it did; without a finding, the reason.
        copies: which trials are copies of each other.
        left_out: how many trials per side were looked at and do not count, since they are copies.
        doubt: why a decision of the tests does not count: it hangs on trials that ran out of time.
    """

    outcome: Outcome
    look: Look
    trials: Trials
    finding: Finding | None
    note: str = ""
    copies: str = ""
    left_out: int = 0
    doubt: str = ""


Fetch = Callable[[Source, tuple[int, ...]], tuple[TrialResult, ...]]
"""Returns the trials of a source for some seeds, in their order."""


def fetch_from(source: Source, seeds: tuple[int, ...]) -> tuple[TrialResult, ...]:
    """Return a source's trials in the order of `seeds`; the source may return them in any order."""
    by_seed = {trial.seed: trial for trial in source.fetch(seeds)}
    if sorted(by_seed) != sorted(seeds):
        raise ValueError(f"{source.label} returned the seeds {sorted(by_seed)} when asked for {list(seeds)}.")
    return tuple(by_seed[seed] for seed in seeds)


def judge(
    assertion: Assertion, design: Design, fetch: Fetch = fetch_from, *, claim: str = "", tier: str = ""
) -> Verdict:
    """Judge an assertion by the trials of its sources (see `decide`); `claim` and `tier` are for the fingerprint.

    Raises:
        Exception: whatever a source raises when it is asked for trials.
    """
    mark = fingerprint(assertion, design, claim=claim, tier=tier)
    ending = decide(assertion, design, fetch)
    if ending is None:
        return _underpowered(assertion, design, mark)
    outcome, look, finding, n = ending.outcome, ending.look, ending.finding, ending.look.n + ending.left_out
    if finding is None:
        return Verdict(outcome, ending.note.removesuffix("; "), assertion.describe(), mark, n=n, copies=ending.copies)
    tested = any(entry.p is not None for entry in finding.evidence)  # a fact has no p
    by_fact = {side: finding.evidence[finding.deciding(side)].p is None for side in Direction}

    def p_of(side: Direction, p: float | None) -> float | None:
        return p if tested and not (by_fact[side] and p == 0.0) else None

    return Verdict(
        outcome=outcome,
        reason=ending.note + (ending.doubt or _reason(finding, look, assertion, design)),
        describe=assertion.describe(),
        fingerprint=mark,
        n=n,
        alpha=look.alpha,
        p=p_of(Direction.FOR, finding.p.supported),
        attainable_p=finding.attainable.supported if tested else None,
        p_refuted=p_of(Direction.AGAINST, finding.p.refuted),
        attainable_p_refuted=finding.attainable.refuted if tested else None,
        evidence=finding.evidence,
        without_result=_ended(assertion, ending.trials, "diverged", "timeout"),
        overspent=overspent(assertion, ending.trials)[0],
        copies=ending.copies,
        deciding=finding.deciding(outcome.direction),
        p_smaller=p_of(Direction.SIZE, finding.p.smaller),
        attainable_p_smaller=finding.attainable.smaller,
    )


def decide(assertion: Assertion, design: Design, fetch: Fetch = fetch_from) -> Ending | None:
    """Follow the looks of a design to their end.

    Each look first checks the smallest attainable p: if neither direction can be decided, no trial is fetched. Nor is
    any where a source cannot have as many trials as the look asks for.
    Judging ends at the first decisive look, or when no outcome of the remaining trials could change the verdict
    (curtailment). An effect that is smaller than claimed stays so, but later looks may refute the claim. Trials that
    ran out of time decide nothing by that alone: they could have had any result. `fetch` gets the trials of a source
    for some seeds, in their order.

    Returns:
        The end; None if no look can decide.

    Raises:
        Exception: whatever a source raises when it is asked for trials.
    """
    looks, ending, smaller, later = assertion.looks(design), None, None, False
    for index, look in enumerate(looks):
        if not _decidable(assertion.attainable(look.n, design), look.alpha):
            continue
        if short := _shortage(assertion, look):
            ending = ending and replace(ending, note=f"{ending.note}{short}; ")
            break
        sources = assertion.sources()
        trials = {one.fingerprint: fetch(one, design.seeds(look.n, one.existing < math.inf)) for one in sources}
        crashed = _crashed(assertion, trials)
        if crashed:
            return Ending(Outcome.ERROR, look, trials, None, crashed)
        if refusal := overspent(assertion, trials)[1]:
            return Ending(Outcome.ERROR, look, trials, None, refusal)
        found = copies(assertion, trials)
        if found.alone:
            return Ending(Outcome.INCONCLUSIVE, look, trials, None, _all_copies(found.alone, look.n))
        try:
            if found.sentence:
                ending = _counted_once(assertion, design, look, trials, found)
            else:
                finding = assertion.find(trials, design, look.alpha)
                ending = Ending(finding.p.outcome(look.alpha), look, trials, finding)
        except UnreadableTrialError as error:
            return Ending(Outcome.ERROR, look, trials, None, str(error))
        ending, settled = _with_any_result(ending, look, trials, assertion, design), None
        if ending.outcome is Outcome.INCONCLUSIVE and not found.sentence:  # later trials may be copies, too
            settled = _settled(assertion, _in_time(trials), looks[index + 1 :], design)
            if settled:
                ending = replace(ending, outcome=settled[0], note=settled[1])
        later = smaller is not None
        if ending.outcome is Outcome.SMALLER and look is not looks[-1]:  # a later look may refute it, not save it
            smaller = smaller or ending
        elif ending.outcome is Outcome.REFUTED or (
            smaller is None and (ending.outcome is not Outcome.INCONCLUSIVE or settled)
        ):
            return ending
    if smaller is not None and later:
        n = smaller.look.n + smaller.left_out
        smaller = replace(smaller, note=f"{smaller.note}more trials do not refute it: of n = {n}, ")
    return smaller or ending


def _in_time(trials: Trials) -> Trials:
    return {mark: tuple(trial for trial in of if trial.status != "timeout") for mark, of in trials.items()}


def _with_any_result(ending: Ending, look: Look, trials: Trials, assertion: Assertion, design: Design) -> Ending:
    """Return a decision only where it would be the same with any result of the trials that ran out of time.

    That is asked of the trials that count, and of all `trials` of the look.
    """
    for at, of in ((ending.look, ending.trials), (look, trials)):
        known = _in_time(of)
        if known != of and (doubt := _doubt(assertion, ending.outcome, at, design, known)):
            return replace(ending, outcome=Outcome.INCONCLUSIVE, doubt=f"{_ended(assertion, of, 'timeout')}; {doubt}")
    return ending


def _doubt(assertion: Assertion, outcome: Outcome, look: Look, design: Design, known: Trials) -> str:
    """Return why an outcome hangs on trials that ran out of time; empty if it would be the same with any result."""
    if outcome is Outcome.INCONCLUSIVE:
        return ""
    p = assertion.highest(known, look.n, design).toward(outcome.direction)
    if p > look.alpha:
        return f"with other results of theirs it need not be {outcome} (p up to {p:.3g}): give them more time"
    if outcome is Outcome.SMALLER and assertion.bounds(known, look.n, design)[0].refuted <= look.alpha:
        return "with other results of theirs it may be refuted: give them more time"
    return ""


def attainability(assertion: Assertion, design: Design) -> tuple[tuple[Look, PValues], ...]:
    """Return the smallest p, for and against, that each look can give; needs no trial."""
    return tuple((look, assertion.attainable(look.n, design)) for look in assertion.looks(design))


def needed_trials(assertion: Assertion, design: Design) -> int | None:
    """Return the fewest trials per side with which the last look could support the assertion, or None."""
    alpha = design.last.alpha
    # Attainable p never rises with n, so bisection finds the smallest n that suffices.
    below = bisect_left(
        range(1, MAX_TRIALS + 1), True, key=lambda n: assertion.attainable(n, design).supported <= alpha
    )
    return below + 1 if below < MAX_TRIALS else None


def _decidable(attainable: PValues, alpha: float) -> bool:
    return min(attainable.supported, attainable.size) <= alpha


def _shortage(assertion: Assertion, look: Look) -> str:
    """Say which source has too few trials for a look, which is then not taken; empty if none has."""
    for source in assertion.sources():
        if look.n > source.existing:
            few = f"there are {source.existing}" if source.existing > 1 else "there is 1"
            return f"underpowered: needs n = {look.n} trials of {source.label}, and {few}"
    return ""


def _crashed(assertion: Assertion, trials: Trials) -> str:
    """Return a sentence that names the crashed trials, or nothing; equal messages of a condition are named once."""
    sentences = []
    for source in assertion.sources():
        mine = trials[source.fingerprint]
        if crashed := [trial for trial in mine if trial.status == "crashed"]:
            seeds = ", ".join(trial.seed_in_words for trial in crashed)
            reasons = list(dict.fromkeys(filter(None, map(why, crashed))))
            first = f": {'the first: ' * (len(reasons) > 1)}{reasons[0]}{place(crashed)}" if reasons else ""
            plural = "s" * (len(crashed) > 1)
            sentences.append(
                f"{len(crashed)} of {len(mine)} trials of {source.label} crashed (seed{plural} {seeds}){first}"
            )
    return "; ".join(sentences)


def _all_copies(label: str, n: int) -> str:
    """Return the sentence on a condition that has a single trial in truth."""
    return (
        f"all {n} trials of {label} are copies of one: training gave the same, whatever the seed. Tests take trials "
        "for independent: does the method draw from its key or seed? One without chance, such as a control, declares "
        "deterministic = True; in_every_trial() asserts facts. A training loop whose trainings do differ reports or "
        "returns numbers that show it. A table has each run once"
    )


def _counted_once(assertion: Assertion, design: Design, look: Look, trials: Trials, found: Copies) -> Ending:
    """Return how a look ends whose trials have copies among them.

    Copies count once. Equal trials may also be independent by chance, and leaving these out would favour what is rare:
    so a decision needs both, the trials that count and all trials. Each test is valid at the look's alpha in its case.

    Raises:
        UnreadableTrialError: when a number of a finished trial cannot be judged.
    """
    counted = Look(found.kept, look.alpha)
    what = f"{found.sentence}, which count once: n = {found.kept} instead of {look.n}; "
    if not _decidable(assertion.attainable(counted.n, design), counted.alpha):
        note = f"{what}underpowered: {_needs(assertion, design)}; "
        return Ending(Outcome.INCONCLUSIVE, counted, found.trials, None, note, found.sentence, look.n - found.kept)
    of_all = assertion.find(trials, design, look.alpha).p.outcome(look.alpha)
    finding = assertion.find(found.trials, design, counted.alpha)
    outcome = finding.p.outcome(counted.alpha)
    if outcome is not of_all and outcome is not Outcome.INCONCLUSIVE:
        what += f"with all {look.n} trials it would be {of_all}, and decided is what both show; "
    agreed = outcome if outcome is of_all else Outcome.INCONCLUSIVE
    return Ending(agreed, counted, found.trials, finding, what, found.sentence, look.n - found.kept)


def _ended(assertion: Assertion, trials: Trials, *statuses: str) -> str:
    """Return a clause that names the trials which ended so, or nothing."""
    words = {"diverged": "diverged", "timeout": OUT_OF_TIME}
    found = [
        f"{len(seeds)} of {len(mine)} trials of {source.label} {words[status]} (seeds {', '.join(seeds)})"
        for source in assertion.sources()
        for mine in [trials[source.fingerprint]]
        for status in statuses
        if (seeds := [trial.seed_in_words for trial in mine if trial.status == status])
    ]
    return "; ".join(found)


def _settled(
    assertion: Assertion, trials: Trials, later: tuple[Look, ...], design: Design
) -> tuple[Outcome, str] | None:
    """Return the verdict that every completion of the trials would give, or None while it is open."""
    for look in later:
        low, high = assertion.bounds(trials, look.n, design)
        for_open, against_open = low.supported <= look.alpha, low.size <= look.alpha
        if high.supported <= look.alpha and not against_open:
            return Outcome.SUPPORTED, _stopped(look)
        if high.refuted <= look.alpha and not for_open:
            return Outcome.REFUTED, _stopped(look)
        if for_open or against_open:
            return None
    return (Outcome.INCONCLUSIVE, _stopped(later[-1])) if later else None


def _stopped(look: Look) -> str:
    return f"stopped early: no outcome of the trials up to n = {look.n} could change the verdict; "


def _reason(finding: Finding, look: Look, assertion: Assertion, design: Design) -> str:
    """Say why a look came out as it did."""
    p, attainable, at = finding.p, finding.attainable, f"alpha = {look.alpha:g} at n = {look.n}"
    outcome = p.outcome(look.alpha)
    facts = "; ".join(entry.detail for entry in finding.evidence if entry.p is None)
    if facts and all(entry.p is None for entry in finding.evidence):
        return facts
    decided = finding.evidence[finding.deciding(outcome.direction)]
    if outcome in (Outcome.SUPPORTED, Outcome.REFUTED) and decided.p is None:
        return f"{decided.describe}: {decided.detail}"
    if outcome is Outcome.SUPPORTED:
        return f"p = {p.supported:.3g} <= {at}"
    if outcome is Outcome.REFUTED:
        return f"p = {p.refuted:.3g} against it <= {at}"
    if outcome is Outcome.SMALLER:
        shown = f", though it is above (p = {p.supported:.3g})" if p.supported <= look.alpha else ""
        return f"p = {p.size:.3g} against an effect as large as claimed <= {at}{shown}"
    if p.supported <= look.alpha:
        return f"the evidence contradicts itself: p = {p.supported:.3g} for and {p.refuted:.3g} against, {at}"
    if not _decidable(attainable, look.alpha):
        if tied := _tied(finding):
            return f"{tied}: nothing to compare"
        smallest = min(attainable.supported, attainable.size)
        return f"underpowered: with these ties the smallest attainable p is {smallest:.3g} > {at}"
    size = "" if p.smaller is None else f" ({p.size:.3g} against its size)"
    evidence = f"the evidence: p = {p.supported:.3g} for and {p.refuted:.3g} against{size}, {at}"
    if assertion.attainable(look.n, design).supported > look.alpha:
        return f"{evidence}; underpowered for support: {_needs(assertion, design)}"
    if attainable.supported > look.alpha:
        return f"{evidence}; with these ties support is out of reach"
    return evidence


def _tied(finding: Finding) -> str:
    """Return a clause about samples in which all trials have one value, as where none gets there; else nothing."""
    for entry in finding.evidence:
        values = {value for sample in entry.samples for value in sample.values}
        if len(values) == 1:
            sizes, (value,), first = [len(sample.values) for sample in entry.samples], values, entry.samples[0]
            if value < math.inf or first.limit is None:
                return f"all {' and '.join(map(str, sizes))} trials have the value {value:g}"
            what, _, event = first.label.partition(": ")[2].partition(", within ")[0].partition(" until ")
            reached = event.replace(" is ", " reaches ", 1) or "an end is seen"
            none = " and ".join(f"0 of {size}" for size in sizes)
            return f"in {none} trials {reached} within {first.limit:,.12g} {what}"
    return ""


def _needs(assertion: Assertion, design: Design) -> str:
    needed = needed_trials(assertion, design)
    if needed is None:
        return f"no n up to {MAX_TRIALS} suffices at alpha = {design.last.alpha:g}"
    return f"needs n = {needed} at alpha = {design.last.alpha:g}"


def _underpowered(assertion: Assertion, design: Design, mark: str) -> Verdict:
    """Return the verdict of a design in which no look can decide."""
    look, attainable = attainability(assertion, design)[-1]
    decidable = (one for one in assertion.looks(design) if _decidable(assertion.attainable(one.n, design), one.alpha))
    short = "".join(_shortage(assertion, one) for one in list(decidable)[:1])
    return Verdict(
        outcome=Outcome.INCONCLUSIVE,
        reason=short or f"underpowered: {_needs(assertion, design)}",
        describe=assertion.describe(),
        fingerprint=mark,
        alpha=look.alpha,
        attainable_p=attainable.supported,
        attainable_p_refuted=attainable.refuted,
    )
