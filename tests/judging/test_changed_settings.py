"""What differs between two conditions is named, setting by setting."""

from __future__ import annotations

from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from evoclaims.judging.drift import MOST, changed_settings

LEAVES = st.one_of(st.none(), st.booleans(), st.integers(-3, 3), st.text(max_size=3))
SPECS = st.dictionaries(
    st.sampled_from("abc"),
    st.recursive(
        LEAVES, lambda part: st.lists(part, max_size=2) | st.dictionaries(st.sampled_from("xy"), part), max_leaves=4
    ),
)


def test_each_changed_setting_is_named_with_both_values() -> None:
    old = {"method": {"name": "es", "settings": {"sigma": 0.5, "lr": 1}}, "task": {"layers": [4, 4]}, "seed": 1}
    new = {"method": {"name": "es", "settings": {"sigma": 0.3, "rank": True}}, "task": {"layers": [4, 8]}, "seed": 2}
    assert changed_settings(old, new) == (
        "method.settings.lr 1 -> none, method.settings.rank none -> True, method.settings.sigma 0.5 -> 0.3, "
        "task.layers.1 4 -> 8"
    )


def test_many_changes_are_counted() -> None:
    old, new = ({str(at): value for at in range(MOST + 3)} for value in (0, 1))
    assert changed_settings(old, new).endswith(", and 3 more")


@given(SPECS, SPECS)
@settings(max_examples=40)
def test_nothing_is_named_exactly_where_nothing_differs(old: dict[str, Any], new: dict[str, Any]) -> None:
    assert (changed_settings(old, new) == "") == (repr(_sorted(old)) == repr(_sorted(new)))


def _sorted(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _sorted(value[key]) for key in sorted(value)}
    return [_sorted(part) for part in value] if isinstance(value, list) else value


def test_an_edited_robot_is_named_by_its_file_not_by_hashes() -> None:
    old = {"task": {"robot": {"xml": "mine:rover.xml", "body": "1f", "frames": 5}}}
    edited = {"task": {"robot": {**old["task"]["robot"], "body": "2e"}}}
    other = {"task": {"robot": {"xml": "mine:car.xml", "body": "2e", "frames": 5}}}
    assert changed_settings(old, edited) == (
        "task.robot.xml 'mine:rover.xml': this file, or one that it includes, was edited"
    )
    assert changed_settings(old, other) == "task.robot.xml 'mine:rover.xml' -> 'mine:car.xml'"
    old["task"]["robot"].pop("body")  # a trial from before there was a hash
    assert changed_settings(old, edited) == "task.robot.body none -> '2e'"
    assert changed_settings({"body": "1f"}, {"body": "2e"}) == "body '1f' -> '2e'"
