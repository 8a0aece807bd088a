"""Evaluation of policies: scenarios, metrics, comparison, report."""
