"""What a part is: its fields, described once, from which files, JSON, schemas, controls and messages derive."""
