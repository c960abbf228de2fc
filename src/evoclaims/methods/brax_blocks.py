"""The parts of Brax that PPO is made of, imported in one place, when they are used."""

from __future__ import annotations

from evoclaims.core.foreign import Later

losses = Later("brax.training.agents.ppo.losses")
networks = Later("brax.training.agents.ppo.networks")
running_statistics = Later("brax.training.acme.running_statistics")
specs = Later("brax.training.acme.specs")
types = Later("brax.training.types")
