"""The reproduction of the papers and its report."""
