"""What a variant of the protocol will cost to run; what is committed need not run."""

from __future__ import annotations

from collections.abc import Sequence

from evoclaims.cli.processes.execution import Execution
from evoclaims.paper import references
from evoclaims.paper.pace import known_pace
from evoclaims.paper.variant import Names
from evoclaims.report.formatting import plural
from evoclaims.report.live_line import duration
from evoclaims.trials import devices
from evoclaims.trials.batches import StoredTrials
from evoclaims.trials.result import COMPLETE


def to_run(running: Execution, names: Sequence[Names]) -> list[Names]:
    """Print what the conditions of a variant cost here, and return those that are not committed.

    Times are upper bounds, by earlier trials of the variant or of the protocol on such a device.
    """
    reproduction, store = running.project.reproduction, running.project.store
    tier, variant, seeds = running.order.tier, running.order.variant, running.order.seeds
    varied, plain = reproduction.tier(tier, variant), reproduction.tier(tier)
    folder, kind = reproduction.references, devices.choose(running.device)[0].device_kind
    chosen, seconds, unknown = [], 0.0, 0
    print(f"{variant}: {reproduction.variants[variant].says}")
    for method, task in names:
        condition = varied.condition(method, task)
        missing = len(StoredTrials(store, condition, time_limit=running.limit).missing(seeds))
        committed = references.of_condition(folder, tier, method, task, condition.id)
        known = {one.seed for one in committed if one.status in COMPLETE}
        says = "stored"
        if missing and known >= set(seeds):
            says = "committed, so not run; name method and task to run it here"
        else:
            chosen.append((method, task))
        if missing and (method, task) in chosen:
            found = known_pace(condition, store, folder, tier, method, task, kind) or known_pace(
                plain.condition(method, task), store, folder, tier, method, task, kind
            )
            took = 0.0 if found is None else found.seconds(condition, missing)
            seconds, unknown = seconds + took, unknown + (found is None)
            says = f"{plural(missing, 'trial')} to run, {f'at most {duration(took)}' if found else 'time unknown'}"
        print(f"  {method} on {task} ({tier}): {says}")
    more = f", and {plural(unknown, 'condition')} of unknown time" * bool(unknown)
    print(f"at most {duration(seconds)} on such a device ({kind}){more}", flush=True)
    return chosen
