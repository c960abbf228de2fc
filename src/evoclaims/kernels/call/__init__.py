"""Kernels in jax's programs: primitives, their batches and derivatives, and the kernels that evoclaims calls."""
