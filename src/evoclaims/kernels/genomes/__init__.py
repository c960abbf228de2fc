"""Loops over NEAT's genomes, written as LLVM's instructions; methods and networks have the same functions in jax."""
