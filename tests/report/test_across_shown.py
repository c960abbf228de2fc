"""What `evoclaims across` has found, in the report: kept in its store, and shown."""

from __future__ import annotations

from pathlib import Path

import pytest
from hand_made_verdicts import report
from laboratory import Laboratory
from unpacked import whole

from evoclaims.core.errors import UserError
from evoclaims.report.across import FILE, keep, last
from evoclaims.verdicts.across import Across, Judged, across

HOSTILE = "evosax <script>alert(1)</script>"


@pytest.fixture
def found() -> Across:
    """Two claims in three environments, the last of which has no verdicts; the second changes one."""
    return across(
        [
            Judged("evosax 0.3.1", {"B": report("B", "supported"), "A": report("A", "supported")}, {}),
            Judged(HOSTILE, {"B": report("B", "refuted"), "A": report("A", "supported")}, {}),
            Judged("evosax 9", {}, {}, trouble="no wheel"),
        ]
    )


def test_the_newest_table_is_read_back_as_it_was_kept(tmp_path: Path, found: Across) -> None:
    assert last([tmp_path, tmp_path / "none"]) is None
    (tmp_path / "other").mkdir()
    keep(found, tmp_path, "2026-02-01 10:00+00:00", "evoclaims across --package evosax 0.3.1")
    keep(found, tmp_path / "other", "2026-01-01 10:00+00:00", "an older one")
    shown = last([tmp_path, tmp_path / "other"])
    assert shown is not None
    assert (shown.made, shown.command) == ("2026-02-01 10:00+00:00", "evoclaims across --package evosax 0.3.1")
    assert [claim for claim, _ in shown.rows] == ["B", "A"]
    assert [lines[0] for lines in dict(shown.rows)["B"]] == ["✓ supported", "✗ refuted, CHANGED", "–"]
    assert f"{HOSTILE}: B: supported -> refuted" in shown.lines


def test_a_file_that_holds_something_else_is_named(tmp_path: Path) -> None:
    (tmp_path / FILE).write_text("{}")
    with pytest.raises(UserError, match=r"across\.json is not a file of `evoclaims across` .* Delete it"):
        last([tmp_path])


def test_the_page_has_it_and_shows_hostile_labels_as_they_are(
    tmp_path: Path, filled: Laboratory, found: Across
) -> None:
    keep(found, tmp_path, "2026-02-01", "evoclaims across")
    page = filled.page(across=last([tmp_path]))
    text = whole(page)
    assert '<details class="chapter" id="across"' in text
    assert "changes B; evosax 9 has no verdicts." in text
    assert "<td>✗ refuted, CHANGED<br>–</td>" in text
    assert "alert(1)" in text
    assert text.count("<script>") == 1
    assert 'id="across"' not in whole(filled.page())
