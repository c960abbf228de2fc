"""What must hold of a store under attack, at any moment and at the end."""

from __future__ import annotations

import io
from collections import Counter
from contextlib import redirect_stdout
from dataclasses import dataclass, field
from typing import Any

from bench import Bench, Running, Truth, digests_of
from tally import Tally
from tortured_project import TRIALS

from evoclaims.cli.main import main as evoclaims


@dataclass
class Guard:
    """Looks at a bench again and again, and tells a tally what is wrong.

    Attributes:
        once: whether no trial may be run twice; where a live process was taken for dead it may.
        lost: ids of trials that were stored and at some moment were not there, or are missing at the end.
    """

    bench: Bench
    truth: Truth
    tally: Tally
    once: bool = True
    lost: set[str] = field(default_factory=set)
    _seen: dict[str, bytes] = field(default_factory=dict)

    @property
    def repeated(self) -> Counter[str]:
        """How often trials were run again, by id."""
        times = Counter(line["id"] for line in self._puts())
        return times - Counter(times.keys())

    def look(self) -> None:
        """Nothing that was stored is lost or changed; to be called at any moment."""
        said = {line["id"] for line in self._puts()}
        records = self.bench.records()
        self.lost |= (said | self._seen.keys()) - records.keys()
        for name, data in self._seen.items():
            self.tally.demand(name in records, f"the finished trial {name[:8]} was lost")
            self.tally.demand(records.get(name, data) == data, f"the record of trial {name[:8]} was written again")
        for name in sorted(said - records.keys()):
            self.tally.demand(False, f"trial {name[:8]} was said to be stored and is not there")
        for name, digest in digests_of(records).items():
            self.tally.demand(self.truth.digests.get(name) == digest, f"trial {name[:8]} has another digest")
        self._seen = records

    def finish(self) -> None:
        """All trials are there, each once, none was begun anew that had a checkpoint, and the store is sound."""
        self.look()
        missing = self.truth.digests.keys() - self._seen.keys()
        self.lost |= missing
        self.tally.demand(not missing, f"{len(missing)} trials are missing at the end")
        for line in self._puts():
            self.tally.demand(line["became"] != "differs", f"trial {line['id'][:8]} came out differently")
        if self.once:
            self.tally.demand(not self.repeated, f"trials were run again: {self.repeated.most_common(3)}")
            self._trained_no_longer()
        self._went_on()
        self.tally.done["finished trials compared"] += len(self._seen)
        self.tally.done["lost"] += len(self.lost)
        self.tally.done["repeated"] += self.repeated.total()
        with redirect_stdout(io.StringIO()) as shown:
            evoclaims(["verify", "--dry-run", "--storage", str(self.bench.store)])
        bad = [
            line for line in shown.getvalue().splitlines() if line.startswith(("record ", "champion ", "checkpoint "))
        ]
        self.tally.demand(not bad, f"verify says {bad}")
        self.tally.demand(f"{len(self.truth.digests)} trials" in shown.getvalue(), f"verify says {shown.getvalue()}")
        self.bench.kept = bool(self.tally.violations)
        print(self.tally, flush=True)

    def judged(self, running: Running) -> None:
        """The verdicts of a run are those of the truth."""
        self.tally.done["verdicts compared"] += len(running.verdicts())
        found, known = running.verdicts(), self.truth.verdicts
        names = [claim["claim"] for claim in found]
        self.tally.demand(names == [claim["claim"] for claim in known], f"other claims: {names}")
        for claim, true in zip(found, known, strict=False):
            other = {key: value for key, value in claim.items() if value != true.get(key)}
            self.tally.demand(not other, f"another verdict of {claim['claim']}: {other}")

    def plainly(self, running: Running, text: str = "") -> None:
        """What a run has printed holds a text, and is made for people."""
        shown = running.output
        self.tally.demand(text in shown, f"{text!r} was not said: {shown[-2000:]}")
        for word in ("Traceback", "INTERNALERROR"):
            self.tally.demand(word not in shown, f"{word} was shown: {shown[-3000:]}")

    def _puts(self) -> list[dict[str, Any]]:
        return [line for line in self.bench.events() if line["what"] == "put"]

    def _trained_no_longer(self) -> None:
        """Nobody trains a condition whose trials are all stored, but for whoever has just stored the last."""
        stored: Counter[str] = Counter()
        last: dict[str, int] = {}
        again = set()
        for line in self.bench.events():
            if line["what"] == "put":
                stored[line["condition"]] += 1
                last[line["condition"]] = line["pid"]
            elif line["what"] == "training" and stored[line["condition"]] >= TRIALS:
                again |= {line["condition"][:8]} if line["pid"] != last[line["condition"]] else set()
        self.tally.demand(not again, f"conditions were trained when all their trials were stored: {sorted(again)}")

    def _went_on(self) -> None:
        """Whoever takes over a batch begins where the one before has said that it was, or later."""
        last: dict[str, int] = {}
        runners: dict[str, set[int]] = {}
        for line in self.bench.events():
            if line["what"] != "training":
                continue
            known, steps = runners.setdefault(line["condition"], set()), last.get(line["condition"], 0)
            if known and line["pid"] not in known:
                self.tally.done["batches gone on with"] += 1
                fell = line["steps"] < steps and self.once
                self.tally.demand(not fell, f"from step {steps} a batch fell back to {line['steps']}")
            known.add(line["pid"])
            last[line["condition"]] = line["steps"]
