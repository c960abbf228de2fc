"""A method: a training loop, which evoclaims calls once for each trial, in a process of its own.

It is outside of `our_paper`, so that these processes need not import what runs.
"""

import numpy as np


def hill_climber(task, seed, budget, report, spread=0.5):
    """Return what was measured, and the policy to examine; with a spread of 0, it is the first guess."""
    random, environment = np.random.default_rng(seed), task.make()  # all that is random derives from the trial's seed
    best, best_return, steps = random.normal(size=4), -np.inf, 0
    while steps < budget.environment_steps:
        child = (1 - spread) * best + spread * random.normal(size=4)
        seen, _ = environment.reset(seed=int(random.integers(2**31)))
        total, ended = 0.0, False
        while not ended and steps < budget.environment_steps:
            seen, reward, terminated, truncated, _ = environment.step(int(seen @ child > 0))
            total, steps, ended = total + reward, steps + 1, terminated or truncated
        if total >= best_return:
            best, best_return = child, total
        report(steps, fitness=best_return)
    return {"best_return": best_return}, lambda seen: int(seen @ best > 0)
