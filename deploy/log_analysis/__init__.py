"""Analysis of logs."""
