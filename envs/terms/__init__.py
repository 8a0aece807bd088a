"""The terms that a task is made of, a file for each kind."""
