"""What people start: the command line, the reproduction of the papers, reports."""
