"""Claims in an order of their own: in one process, or given to xdist's workers one by one.

The first of xdist's workers looks up what the claims need and how long it takes, and leaves that in a file for the
controller, which collects no tests itself.

Nothing heavy is imported here at the top: pytest loads this file in every run of an environment that has evoclaims.
"""

from __future__ import annotations

import shutil
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import pytest

from evoclaims.core.errors import UserError
from evoclaims.core.files import read_file
from evoclaims.plugin.progress import progress_of

if TYPE_CHECKING:
    from evoclaims.claims.claim import ClaimTest
    from evoclaims.claims.session import Session
    from evoclaims.claims.workload import Workload

FILE: Final = "claims_workload"
"""Name under which the controller sends its workers the file."""

_OTHER_ORDERS: Final = ("failedfirst", "newfirst", "stepwise")
"""Options that ask for an order of tests, or depend on it."""


def prepare(session: pytest.Session, judging: Session, tests: dict[pytest.Item, ClaimTest]) -> None:
    """Find out what the collected claims need; in a run without workers, put them in order."""
    from evoclaims.claims.workload import workload

    config = session.config
    given: dict[str, Any] | None = getattr(config, "workerinput", None)
    if given is not None and (FILE not in given or given["workerid"] != "gw0"):
        return
    load = workload(judging, tests)
    if load is None:
        return
    if given is not None:
        import msgspec

        from evoclaims.core.files import write_atomically

        file = Path(given[FILE])
        if file.parent.is_dir():  # not so for a worker on another machine
            with suppress(UserError):
                write_atomically(file, msgspec.json.encode(load))  # the controller may read at any time
        return
    line = progress_of(config)
    if line is not None:
        line.begin(load, workers=1, tick=False)
    if is_ordered(config):
        session.items[:] = in_order(session.items, load)


def is_ordered(config: pytest.Config) -> bool:
    """Whether no option asks for another order of tests."""
    return not any(config.getoption(name, False) for name in _OTHER_ORDERS)


def in_order(items: list[pytest.Item], load: Workload) -> list[pytest.Item]:
    """Return tests in the order for one process: the claims change places among themselves, all others stay."""
    from evoclaims.claims.workload import Order

    order, claims = Order[str](load, 1), dict[str, pytest.Item]()
    first = {id(claims.setdefault(item.nodeid, item)) for item in items if item.nodeid in load.claims}
    ordered = []
    for item in items:
        if id(item) in first:
            chosen = order.next("", list(claims))
            order.ended(chosen)
            ordered.append(claims.pop(chosen))
        else:  # a plugin's repetition of a claim, too
            ordered.append(item)
    return ordered


class Distribution:
    """The part of xdist's controller: gives claims to workers in an order of its own."""

    def __init__(self, config: pytest.Config) -> None:
        """Prepare nothing yet."""
        self._config = config
        self._folder: Path | None = None

    @pytest.hookimpl(optionalhook=True)
    def pytest_configure_node(self, node: Any) -> None:
        """Tell a worker where to leave what the claims need."""
        if self._folder is None:
            from evoclaims.core.files import temporary_folder

            self._folder = temporary_folder()
        node.workerinput[FILE] = str(self._folder / "workload.json")

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_node_collection_finished(self, node: Any) -> None:
        """Read what the first worker has left."""
        file = Path(node.workerinput.get(FILE, ""))
        if not file.is_file():
            return
        import msgspec

        from evoclaims.claims.workload import Workload
        from evoclaims.plugin.scheduling import LOAD

        if LOAD in self._config.stash:
            return

        load = self._config.stash[LOAD] = msgspec.json.decode(read_file(file), type=Workload)
        line = progress_of(self._config)
        if line is not None:
            line.begin(load, workers=len(node.nodemanager.specs), tick=True)

    @pytest.hookimpl(optionalhook=True)
    def pytest_xdist_make_scheduler(self, config: pytest.Config, log: Any) -> Any:
        """Return a scheduler that orders claims, unless another distribution or order of tests is asked for."""
        if config.getoption("dist") != "load" or not is_ordered(config):
            return None
        from evoclaims.plugin.scheduling import ClaimScheduling

        return ClaimScheduling(config, log)

    def pytest_unconfigure(self) -> None:
        """Remove the file."""
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
