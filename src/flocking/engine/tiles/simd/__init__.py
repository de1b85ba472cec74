"""SIMD building blocks: vectors of 16 lanes, loads, reductions, inverse square root, elementary functions."""
