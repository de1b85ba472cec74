"""Studies in the library: sweeps of the papers' scenarios, each with its picture."""
