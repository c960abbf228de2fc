"""Nisioti et al., GECCO 2025: When Does Neuroevolution Outcompete Reinforcement Learning in Transfer Learning Tasks?"""

from __future__ import annotations

from pathlib import Path

from evoclaims import FIXED_10, SEQUENTIAL, Reproduction, Tier
from reproductions.nisioti2025 import ecorobot, mechanisms, stepping_gates
from reproductions.nisioti2025.measures import PaperTrials
from reproductions.nisioti2025.null_agents import NULL_AGENTS
from reproductions.nisioti2025.variants import VARIANTS

TRIALS = 10
"""Trials of each condition in the paper (§5): their power fixes the margin of comparisons."""

MORE = {
    ("cma_es", "stones"): 90,
    ("map_elites", "stones"): 60,
    ("hyperneat", "stones"): 30,
    ("neat", "stones"): 30,
    ("ppo", "locomotion_half_cheetah"): 30,
}
"""Trials of smoke's conditions for the drift check: ten take one to three seconds (docs/smoke.md)."""

REPRODUCTION = Reproduction(
    name="nisioti2025",
    title="When Does Neuroevolution Outcompete Reinforcement Learning in Transfer Learning Tasks?",
    folder=Path(__file__).parent,
    tiers={
        "smoke": Tier(
            conditions={**stepping_gates.SMOKE, **ecorobot.SMOKE, **mechanisms.CONDITIONS},
            design=FIXED_10.for_paper(TRIALS),
            for_drift=MORE,
            repeat_drift=True,
        ),
        "full": Tier(
            conditions={**stepping_gates.FULL, **ecorobot.FULL, **mechanisms.CONDITIONS},
            design=SEQUENTIAL.for_paper(TRIALS),
        ),
    },
    variants=VARIANTS,
    trials=PaperTrials,
    null_agents=NULL_AGENTS,
    mutants=f"{__name__}.mutants",
    figures=tuple(f"{__name__}.{name}" for name in (*(f"fig{n}" for n in range(3, 11)), "tables")),
)
