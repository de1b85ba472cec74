"""HOW a scenario is computed: generated kernels, located switches, sessions and runs."""
