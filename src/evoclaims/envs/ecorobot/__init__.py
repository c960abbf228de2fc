"""Ecorobot (§3.2 of the paper): robots with sensors in mazes and over obstacles, simulated by MJX."""
