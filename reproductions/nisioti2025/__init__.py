"""Nisioti et al., GECCO 2025: When Does Neuroevolution Outcompete Reinforcement Learning in Transfer Learning Tasks?"""

from __future__ import annotations

from pathlib import Path

from evoclaims.judging.protocol import FIXED_10, SEQUENTIAL
from evoclaims.suite.reproduction import Reproduction, Tier
from reproductions.nisioti2025 import ecorobot, stepping_gates

REPRODUCTION = Reproduction(
    name="nisioti2025",
    title="When Does Neuroevolution Outcompete Reinforcement Learning in Transfer Learning Tasks?",
    folder=Path(__file__).parent,
    tiers={
        "smoke": Tier(conditions={**stepping_gates.SMOKE, **ecorobot.SMOKE}, protocol=FIXED_10),
        "full": Tier(conditions={**stepping_gates.FULL, **ecorobot.FULL}, protocol=SEQUENTIAL),
    },
)
