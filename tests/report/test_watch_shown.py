"""The nights of a watch in the report: the last series of each tier, as lines, with the level of an alarm."""

from __future__ import annotations

from laboratory import Laboratory
from msgspec import structs
from unpacked import whole

from evoclaims.report.training_curves import by_night
from evoclaims.verdicts.watch_file import Night

HOSTILE = "<script>alert(1)</script>"


def night(number: int, series: int, evidence: float, tier: str = "smoke") -> Night:
    found = {HOSTILE: evidence, "neat": 0.5}
    return Night(f"2026-01-{number:02}", tier, series, "", (number,), "cpu", 100.0, {}, {}, found)


def test_the_last_series_is_shown_with_its_alarms() -> None:
    nights = [night(1, 1, 900.0), night(2, 2, 0.1), night(3, 2, 100.0), night(4, 2, 20.0), night(1, 1, 1.0, "full")]
    full, smoke = by_night(nights)
    assert (full.tier, smoke.tier) == ("full", "smoke")
    assert smoke.says.startswith("3 nights up to 2026-01-04, alarm at an evidence of 100. Largest on the last night: <")
    assert smoke.says.endswith(
        f"with 20. Alarms: {HOSTILE}. The alarm of series 1 ({HOSTILE}) stays until a night is run with --restart."
    )
    nights[1] = structs.replace(nights[1], restart=True)
    assert by_night(nights)[1].says.endswith(f"with 20. Alarms: {HOSTILE}.")
    assert full.says.endswith("Alarms: none.")
    first, *_, alarm = smoke.panel.lines
    assert [round(float(y), 3) for y in first.y] == [0, -1, 2, 1.301]
    assert {round(float(y), 3) for y in alarm.y} == {2.0}
    assert by_night([]) == ()


def test_the_page_draws_the_nights(filled: Laboratory) -> None:
    text = whole(filled.page(watch=by_night([night(1, 1, 3.0)])))
    assert '<details class="chapter" id="watch"' in text
    assert 'aria-label="evidence over nights, smoke"' in text
    assert "<title>alarm at 100</title>" in text
    assert text.count("<script>") == 1
    assert 'id="watch"' not in whole(filled.page())
