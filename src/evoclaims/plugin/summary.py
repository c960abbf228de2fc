"""The end of a run: verdict table, comparison with the reference trials, JSON report, exit status."""

from __future__ import annotations

import json
import os
import shlex
import signal
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import pytest

from evoclaims.core.errors import UserError
from evoclaims.core.printable import shown, spelled
from evoclaims.core.tiers import TIERS
from evoclaims.plugin.options import make_session
from evoclaims.plugin.progress import progress_of
from evoclaims.trials.stopping import interrupted_by

if TYPE_CHECKING:
    from evoclaims.judging.drift_report import DigestCheck, DriftReport
    from evoclaims.verdicts.claim_report import ClaimReport
    from evoclaims.verdicts.regression import Regression
    from evoclaims.verdicts.upgrade import Upgrade

ATTRIBUTE: Final = "claim_report"
"""Attribute of a test's report that holds the claim's, also from an xdist worker to its controller."""

TROUBLE: Final = "claims_trouble"
"""Name under which an xdist worker sends its controller the reason why it runs nothing."""


COLLECTED_THERE: Final = "claims_collected"
"""Name under which an xdist worker sends its controller what `COLLECTED` holds."""

COLLECTED: Final[pytest.StashKey[set[tuple[str, str]]]] = pytest.StashKey()
"""Tier and name of all claims of the project; only in a run that has collected all of them."""

KNOWN: Final[pytest.StashKey[set[str]]] = pytest.StashKey()
"""Where a run keeps the ids of the claims that it has collected, selected or not."""


class Summary:
    """Gathers the claims' reports of a run in the process that writes the output, and ends the run with them."""

    def __init__(self, config: pytest.Config) -> None:
        """Start empty."""
        self._config = config
        self.reports: list[ClaimReport] = []
        self._drift: tuple[DriftReport, DigestCheck] | None = None
        self._upgrade: Upgrade | None = None
        self._regression: Regression | None = None
        self._reasons: Mapping[tuple[str, str], str] = {}
        self._troubles: list[str] = []
        self._died: dict[str, str] = {}
        self._interrupted = False

    def pytest_keyboard_interrupt(self, excinfo: pytest.ExceptionInfo[BaseException]) -> None:
        """Note that Ctrl-C has ended the run, and not `pytest.exit`."""
        self._interrupted = excinfo.type is KeyboardInterrupt

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep a claim's report."""
        plain = getattr(report, ATTRIBUTE, None)
        if plain is not None:
            from evoclaims.verdicts.claim_report import ClaimReport

            self.reports.append(ClaimReport.from_json(plain))
            self._died.pop(report.nodeid, None)  # another process has judged it

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node: Any, error: object) -> None:
        """Note which claims an xdist worker has collected, and why it ran nothing; they all say the same."""
        output = getattr(node, "workeroutput", {})
        if COLLECTED_THERE in output:
            self._config.stash[COLLECTED] = {(tier, name) for tier, name in output[COLLECTED_THERE]}
        trouble = output.get(TROUBLE)
        if trouble is not None:
            self.report_trouble(trouble)

    def report_trouble(self, trouble: str) -> None:
        """Keep a sentence for the end of the run, which fails; each once."""
        if trouble not in self._troubles:
            self._troubles.append(trouble)

    @pytest.hookimpl(optionalhook=True)
    def pytest_handlecrashitem(self, crashitem: str) -> None:
        """Note that an xdist worker died on a claim, which has no report then but must be mentioned."""
        if crashitem.endswith(tuple(f"-{tier}]" for tier in TIERS)):  # pytest's own summary has all other tests
            self._died[crashitem] = (
                f"The process that judged {crashitem} died (it was killed, crashed, or found no memory), so that this "
                "claim has no verdict here. Its trials are kept as far as they are, and the same command goes on from "
                "there."
            )

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        """Compare with the reference trials, write the JSON report and set the exit status.

        0: nothing refuted, nothing drifted. 1: something was refuted without being accepted, broke, drifted, or was
        kept from being judged; or a verdict changed as --claims-compare-fail names it; or no claim was judged, with
        --claims-undecided=fail.
        4: xdist's workers refused to begin. 5 (pytest's "no tests"): claims were selected, but no trial was judged
        (for example, all are skipped), so that nothing was measured.
        """
        refused = self._troubles and not session.testscollected
        if self.reports:  # they come in the order in which they were judged
            from evoclaims.claims.earlier_trials import drift, upgraded
            from evoclaims.verdicts import history

            self.reports = history.ordered(self._last_runs())
            with self._telling():
                self._drift = drift(make_session(self._config), self.reports)
            with self._telling():
                self._upgrade = upgraded(make_session(self._config), self.reports)
            with self._telling():
                if self._drift and self._drift[0].drifted and session.exitstatus != pytest.ExitCode.INTERRUPTED:
                    self._write_json()  # a run may be killed while it repeats the drift
                    self._drift = self._repeated(self._drift[0]), self._drift[1]
            with self._telling():
                self._compare_with_accepted()
            with self._telling():
                self._reasons = self._why_changed()
        with self._telling():
            self._write_json()
        if refused and not self.reports:
            session.exitstatus = pytest.ExitCode.USAGE_ERROR
        elif session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = self._status()

    def _last_runs(self) -> list[ClaimReport]:
        """Return one report for each claim: of its last run, whatever ran it again."""
        from evoclaims.verdicts.history import last_runs

        known, last = self.reports, last_runs(self.reports)
        for at, report in enumerate(last):
            if report.earlier and report not in known:  # runs in several processes know nothing of each other
                with self._telling():
                    last[at] = make_session(self._config).save(report)
        return last

    @contextmanager
    def _telling(self) -> Iterator[None]:
        """Report an error when the run has ended, and go on."""
        try:
            yield
        except UserError as error:
            self.report_trouble(str(error))

    def _repeated(self, found: DriftReport) -> DriftReport:
        """Test methods that drifted once more, where they are to be told from chance; Ctrl-C ends only this."""
        from evoclaims.claims.earlier_trials import repeated

        line = progress_of(self._config)
        say = line.remark if line else lambda text: None
        try:
            with interrupted_by(signal.SIGINT):  # which is only answered while a run ends, and this may take long
                return repeated(make_session(self._config), self.reports, found, say)
        except KeyboardInterrupt:
            return found.standing("this was interrupted; the same command goes on from there")
        finally:
            if line:
                line.close()

    def _compare_with_accepted(self) -> None:
        """Compare the verdicts with the last accepted ones, which are for the protocol itself, not for a variant."""
        if not self._config.getoption("claims_variant"):
            from evoclaims.verdicts.regression import regression

            folder = make_session(self._config).reproduction.folder
            changes, collected = self._config.getoption("claims_compare_fail"), self._config.stash.get(COLLECTED, None)
            self._regression = regression(folder, self.reports, changes, collected)

    def _status(self) -> pytest.ExitCode:
        unjudged = self.reports and not self._judged
        if (
            self._troubles
            or any(report.failed for report in self.reports)  # a plugin may have hidden it from pytest
            or (self._drift and self._drift[0].drifted)
            or (self._upgrade and self._upgrade.drifted)
            or (self._regression and self._regression.matched)
            or (unjudged and self._config.getoption("claims_undecided") == "fail")
        ):
            return pytest.ExitCode.TESTS_FAILED
        if self.reports and not any(report.n for report in self.reports):
            return pytest.ExitCode.NO_TESTS_COLLECTED
        return pytest.ExitCode.OK

    @property
    def _judged(self) -> bool:
        return any(report.outcome != "not run" for report in self.reports)

    def pytest_terminal_summary(self, terminalreporter: Any, exitstatus: int) -> None:
        """Print the verdict table and its details."""
        if self._interrupted and self._config.stash.get(KNOWN, ()):
            terminalreporter.write_line("interrupted; what has run is kept, and the same command goes on from there")
        if not self.reports:
            for trouble in [*self._troubles, *self._died.values()]:
                terminalreporter.write_line(self._safe(f"ERROR: {trouble}"), red=True)
            if exitstatus == pytest.ExitCode.NO_TESTS_COLLECTED and self._config.stash.get(KNOWN, ()):
                terminalreporter.write_line(self._safe(self._choices()), yellow=True)
            return
        from evoclaims.report import table_cells, terminal_table
        from evoclaims.report.run_summary import without_smoke_test

        writer = self._config.get_terminal_writer()
        width, colour = writer.fullwidth, writer.hasmarkup
        terminalreporter.section("claims")
        room = terminal_table.columns(width, terminalreporter.isatty)
        table = terminal_table.verdict_table(self.reports, room, colour, self._encoding)
        terminalreporter.write_line(self._drawn(table))
        terminalreporter.write_line("")
        with_test = [report for report in self.reports if report.has_test]
        explained = terminal_table.explanations(with_test, width, colour)
        for part in filter(None, (explained, without_smoke_test(self.reports))):
            terminalreporter.write_line(self._drawn(part))
            terminalreporter.write_line("")
        notes = self._notes()
        for note in notes:
            terminalreporter.write_line(self._safe(note))
        for trouble in [*self._troubles, *self._died.values()]:
            terminalreporter.write_line(self._safe(f"error: {trouble}"), red=True)
        unsaved = sorted({report.unsaved for report in self.reports} - {""})
        warnings = [f"The files of evidence could not be written. {reason}" for reason in unsaved[:1]]
        for warning in (*warnings, *self._unmade(), self._write_step_summary(notes)):
            if warning:
                terminalreporter.write_line(self._safe(f"warning: {warning}"), yellow=True)
        if table_cells.faults(self.reports):
            terminalreporter.write_line(table_cells.faults(self.reports))
        terminalreporter.write_line(f"claims: {table_cells.totals(self.reports)}", bold=True)
        if not any(report.n for report in self.reports):
            what = "No trial was looked at" if self._judged else "No claim was judged"
            terminalreporter.write_line(f"{what}: nothing was measured.", red=True)
        elif not self._config.getoption("claims_variant"):  # whose verdicts nobody accepts
            for line in self._closing_lines():
                terminalreporter.write_line(self._safe(line))

    def _closing_lines(self) -> list[str]:
        from evoclaims.report.run_summary import closing_lines

        changed, regressed = None, []
        if self._regression and self._regression.transitions:
            changed = self._regression.names
            regressed = [f"{one.claim} ({one.tier})" for one in self._regression.matched]
        drifted = [row.label for row in self._drift[0].rows if row.drifted] if self._drift else []
        drifted += self._upgrade.drifted if self._upgrade else []
        return closing_lines(self.reports, changed, list(dict.fromkeys(drifted)), regressed, len(self._troubles))

    def _unmade(self) -> list[str]:
        """Say where the drift check lacks the trials that only it reads; the claims had theirs."""
        from evoclaims.claims.session import SESSION

        session = self._config.stash.get(SESSION, None)
        unmade: dict[str, str] = getattr(session and session.fetch, "unmade", {})
        labels = {source.condition: source.label for report in self.reports for source in report.sources}
        return [
            f"{labels.get(condition, condition)}: trials that only the drift check reads were not made. {why}"
            for condition, why in unmade.items()
        ]

    def _choices(self) -> str:
        """Say how claims are selected, where none was."""
        from evoclaims.verdicts.history import in_order

        known: set[str] = self._config.stash[KNOWN]
        names = sorted(known, key=lambda name: in_order(("", name)))
        given = {"-m": self._config.getoption("markexpr", ""), "-k": self._config.getoption("keyword", "")}
        asked = " with ".join(f"{option} {shlex.quote(value)}" for option, value in given.items() if value)
        return (
            f"No claim was selected{asked and f' by {asked}'}: --claims-only={names[0]} selects claims by their ids, "
            f"{' and '.join(f'-m {tier}' for tier in TIERS)} their tier. Claims here: {', '.join(names)}."
        )

    def _safe(self, text: str) -> str:
        return self._drawn(shown(text))

    def _drawn(self, text: str) -> str:
        return spelled(text, self._encoding)

    @property
    def _encoding(self) -> str | None:
        """The terminal's encoding, if it is known."""
        file: Any = getattr(self._config.get_terminal_writer(), "_file", None)
        return getattr(file, "encoding", None)

    def _notes(self) -> list[str]:
        """Return lines on what comparisons found: with reference trials, trials of other versions, and verdicts."""
        from evoclaims.report import terminal_table
        from evoclaims.verdicts.history import changed_by_repetition

        notes = [line for report in self.reports if (line := changed_by_repetition(report))]
        if self._drift is not None:
            drift, digests = self._drift
            labels = {source.condition: source.label for report in self.reports for source in report.sources}
            changed = [labels.get(change.condition, change.condition) for change in digests.changed]
            notes += terminal_table.drift_lines(drift, changed, digests.compared).splitlines()
        if self._upgrade is not None:
            notes += self._upgrade.lines
        return [*notes, *(self._regression.lines(self._reasons) if self._regression else ())]

    def _why_changed(self) -> dict[tuple[str, str], str]:
        """Return why verdicts may differ from the accepted ones, by tier and claim."""
        if self._regression is None or self._drift is None:
            return {}
        from evoclaims.claims.earlier_trials import new_histories
        from evoclaims.verdicts.acceptance import entry_of
        from evoclaims.verdicts.history import key_of
        from evoclaims.verdicts.regression import reason

        session = make_session(self._config)
        judged = {key_of(report): report for report in self.reports if report.n}
        upgraded = self._upgrade.drift if self._upgrade else None
        return new_histories(session, list(judged.values()), self._regression.accepted) | {
            key: reason(judged[key], old, entry_of(judged[key], session.judged_from, ""), *self._drift, upgraded)
            for key, old in self._regression.changed.items()
            if key in judged
        }

    def _write_json(self) -> None:
        """Write all verdicts to the file that --claims-json names; even if there are none, so no old file stays."""
        from evoclaims.core.files import write_where_named

        name = self._config.getoption("claims_json")
        if name is None or self._config.option.collectonly:
            return
        drift = self._drift[0].to_json() if self._drift else None
        upgrade = self._upgrade.to_json() if self._upgrade else None
        claims = [report.to_json() for report in self.reports]
        plain = {"schema": 1, "claims": claims, "drift": drift, "upgrade": upgrade}
        path = Path(self._config.invocation_params.dir) / name
        text = json.dumps(plain, indent=1, sort_keys=True) + "\n"
        write_where_named(path, text.encode(), "Name a file that can be written with --claims-json.")

    def _write_step_summary(self, notes: Sequence[str]) -> str:
        """Append the verdicts to GitHub's summary page of a step; return why it cannot be written, else nothing.

        This is called only by runs that write to a terminal, so that runs inside `evoclaims` commands add nothing.
        """
        from evoclaims.report.run_summary import run_summary

        name = os.environ.get("GITHUB_STEP_SUMMARY")
        if not name:
            return ""
        try:
            with open(name, "a", encoding="utf-8") as page:
                page.write(run_summary(self.reports, [*notes, *self._troubles, *self._died.values()]))
        except OSError as error:
            return f"Cannot write the verdicts to GitHub's summary {name}: {error.strerror or error}."
        return ""
