"""NEAT (Stanley and Miikkulainen 2002) with TensorNEAT's semantics, written for accelerators."""
