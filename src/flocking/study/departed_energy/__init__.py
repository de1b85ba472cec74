"""Causes of departed energy: what each imperfection of knowledge, control and bodies did to it."""
