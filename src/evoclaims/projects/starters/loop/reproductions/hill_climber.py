"""A method: a training loop, which evoclaims calls once for each trial, in a process of its own.

It is outside of `our_paper`, so that these processes need not import what runs.
"""

import numpy as np


def hill_climber(task, seed, budget, report, spread=0.3):
    """Return the generations that it took, and the policy to examine; with a spread of 1, it is random search."""
    random = np.random.default_rng(seed)  # all that is random derives from the trial's seed
    inputs, targets = task.table.inputs, task.table.targets[:, 0]
    best, success, generation = np.zeros(4), 0.0, 0
    while success < 1 and generation < budget.generations:
        child = (1 - spread) * best + spread * random.normal(size=4)
        right = float(np.mean((inputs @ child[:3] + child[3] > 0) == targets))
        if right >= success:
            best, success = child, right
        generation += 1
        report(generation, success=success)
    return {"steps": generation}, lambda bits: [bits @ best[:3] + best[3]]
