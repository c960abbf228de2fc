"""Functions of small arrays as single GPU kernels: their arithmetic, number by number, a thread for each of a batch."""
