"""What a variant of the protocol will cost to run; what is committed need not run."""

from __future__ import annotations

from collections.abc import Sequence

from evoclaims.cli.processes.execution import Execution
from evoclaims.paper import references
from evoclaims.paper.cost import Estimator, Wanted
from evoclaims.paper.variant import Names
from evoclaims.report.formatting import plural
from evoclaims.report.live_line import duration
from evoclaims.trials.devices import usable_cores
from evoclaims.trials.result import COMPLETE


def to_run(running: Execution, names: Sequence[Names]) -> list[Names]:
    """Print what the conditions of a variant cost here, and return those that are not committed."""
    reproduction, store = running.project.reproduction, running.project.store
    tier, variant, seeds = running.order.tier, running.order.variant, running.order.seeds
    varied = reproduction.tier(tier, variant)
    wanted = {one: Wanted(one, varied.condition(*one), seeds) for one in names}
    owed = Estimator(store, reproduction, tier, running.platform, time_limit=running.limit).owed(wanted)
    chosen, seconds, unknown = [], 0.0, 0
    print(f"{variant}: {reproduction.variants[variant].says}")
    for one, lacking in owed.items():
        committed = references.of_condition(reproduction.references, tier, *one, wanted[one].condition.id)
        if lacking.seeds and {trial.seed for trial in committed if trial.status in COMPLETE} >= set(seeds):
            says = "committed, so not run; name method and task to run it here"
        else:
            chosen.append(one)
            says = "stored"
            if lacking.seeds:
                known, took = lacking.cost.basis != "budget", lacking.cost.seconds(usable_cores())
                seconds, unknown = seconds + took * known, unknown + (not known)
                about = f"about {duration(took)}" if known else "time unknown"
                says = f"{plural(len(lacking.seeds), 'trial')} to run, {about}"
        print(f"  {' on '.join(one)} ({tier}): {says}")
    more = f", and {plural(unknown, 'condition')} of unknown time" * bool(unknown)
    print(f"about {duration(seconds)} on such a device ({running.platform}){more}", flush=True)
    return chosen
