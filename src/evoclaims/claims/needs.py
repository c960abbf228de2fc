"""What a claim test will ask for: found by calling it once without running a trial."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable
from typing import Any

import pytest

from evoclaims.claims.collected import TIER
from evoclaims.judging.assertion import Assertion
from evoclaims.paper.trial_group import TrialGroup


def asked_for(
    item: pytest.Item, tier: str, group: Callable[[str, str], TrialGroup]
) -> tuple[list[TrialGroup], Assertion | None]:
    """Return the trials that a claim test asks for, and its assertion, as far as a call without trials gets.

    Nothing is known of a test with fixtures of its own, which are for the run itself. What a test raises is told when
    it is run.

    Args:
        item: the test.
        tier: to judge it at.
        group: returns trials of a method on a task that cannot be fetched.
    """
    found: list[TrialGroup] = []
    judged: list[Assertion] = []

    def trials(method: str, *, on: str) -> TrialGroup:
        found.append(group(method, on))
        return found[-1]

    function: Callable[..., Any] = item.obj  # type: ignore[attr-defined]
    given = {**item.callspec.params, TIER: tier, "trials": trials, "verdict": judged.append}  # type: ignore[attr-defined]
    names = inspect.signature(function).parameters
    if not set(names) <= set(given):
        return [], None
    try:
        with warnings.catch_warnings(action="ignore"):
            function(**{name: given[name] for name in names})
    except KeyboardInterrupt:
        raise
    except BaseException:  # noqa: S110  (pytest's own outcomes, such as a skip, are no `Exception`)
        pass
    if isinstance(item.parent, pytest.Class):  # the run needs a new object of its class
        vars(item).pop("_instance", None)
        vars(item).pop("_obj", None)
    return found, judged[0] if judged else None
