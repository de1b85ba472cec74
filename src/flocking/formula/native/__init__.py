"""Functions written in a small part of Python, translated to LLVM and compiled in a fraction of a second."""
