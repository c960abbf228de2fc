"""What the methods and the robots are made of, observed on tasks whose answer is known; the same at every tier."""

from __future__ import annotations

from evoclaims import Budget, Condition
from evoclaims.methods.mechanisms import (
    CmaEsMechanisms,
    HyperNeatMechanisms,
    MapElitesMechanisms,
    NeatMechanisms,
    Portrait,
    PpoMechanisms,
    Quadratic,
    Room,
    Spread,
    Stroll,
    TwoNiches,
    Wanderers,
)

_NEAT, _CMA_ES = NeatMechanisms(), CmaEsMechanisms()

CONDITIONS = {
    ("neat_mechanisms", "two_niches"): Condition(
        _NEAT, TwoNiches(), "whole_budget", Budget(generations=10, reports=10)
    ),
    ("cma_es_mechanisms", "sphere"): Condition(
        _CMA_ES, Quadratic(), "whole_budget", Budget(generations=120, reports=6)
    ),
    ("cma_es_mechanisms", "ellipsoid"): Condition(
        _CMA_ES, Quadratic(condition=10_000.0), "whole_budget", Budget(generations=120, reports=6)
    ),
    ("map_elites_mechanisms", "spread"): Condition(
        MapElitesMechanisms(), Spread(), "whole_budget", Budget(generations=10, reports=10)
    ),
    ("ppo_mechanisms", "stroll"): Condition(
        PpoMechanisms(), Stroll(), "whole_budget", Budget(generations=10, reports=10)
    ),
    ("hyperneat_mechanisms", "portrait"): Condition(
        HyperNeatMechanisms(), Portrait(), "whole_budget", Budget(generations=10, reports=10)
    ),
    ("wanderers", "room"): Condition(Wanderers(), Room(), "whole_budget", Budget(generations=1, reports=1)),
}
