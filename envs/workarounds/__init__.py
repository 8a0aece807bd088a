"""Replacements of other libraries' internals, one in each file, with the reason and when to remove it."""
