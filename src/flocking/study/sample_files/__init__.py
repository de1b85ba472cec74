"""Sampled motions from files of other programs: CSV, Parquet, NPZ and GSD, none of them trusted."""
