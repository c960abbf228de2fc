"""A worker process of `evoclaims mutants --numprocesses N`: runs the conditions that it reads, and judges nothing."""

from __future__ import annotations

import sys
from dataclasses import dataclass

import msgspec

from evoclaims.claims.fetching import RunMissing
from evoclaims.cli.project import open_project
from evoclaims.cli.run import run_each
from evoclaims.cli.terminal import plain_output
from evoclaims.core.errors import UserError
from evoclaims.mutants import catalogue
from evoclaims.mutants.conditions import Job, jobs, plantings
from evoclaims.report.live_line import LiveLine
from evoclaims.trials.allowance import end_without

USER_ERROR = 2


@dataclass(frozen=True)
class Order:
    """What a worker is to do.

    Attributes:
        storage: folder of the store.
        tier, device: as the command names them.
        conditions: with which faults, in this order.
    """

    storage: str
    tier: str
    device: str
    conditions: tuple[Job, ...]


def main() -> int:
    """Run the conditions in the order on standard input; errors in one are printed and do not stop the others."""
    order = msgspec.json.decode(sys.stdin.buffer.read(), type=Order)
    with plain_output():
        try:
            project = open_project(order.storage)
            tier = project.reproduction.tier(order.tier)
            sound = {one.names: tier.condition(*one.names) for one in order.conditions}
            known = jobs(sound, plantings(sound, catalogue.load(project.reproduction)))
            line = LiveLine(lambda text: None, None)  # the command tells the progress of all workers
            fetch = RunMissing(project.store, order.device, line, project.config.seconds(None))
            named = [(one.label, known[one]) for one in order.conditions]
            for _ in run_each(named, tier.design.seeds(tier.design.last.n), fetch, line, project.config.root):
                pass
        except UserError as error:
            print(f"evoclaims: {error}", file=sys.stderr)
            return USER_ERROR
    return 0


if __name__ == "__main__":
    status = main()
    end_without(status)
    raise SystemExit(status)
