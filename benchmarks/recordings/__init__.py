"""Fits to public recordings of real machines; nothing of the recordings is part of the project."""
