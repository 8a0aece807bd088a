"""Fits to public recordings of real machines; the recordings are not part of the project."""
