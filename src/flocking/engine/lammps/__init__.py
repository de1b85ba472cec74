"""The cluster engine: a scenario translated to LAMMPS and run on any number of MPI ranks."""
