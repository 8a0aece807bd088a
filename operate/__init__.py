"""Command sources for operators and programs, and code that they share."""
