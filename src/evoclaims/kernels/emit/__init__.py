"""From scalar expressions to LLVM's text, for processors and GPUs, and to machine code."""
