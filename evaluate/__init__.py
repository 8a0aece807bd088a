"""How good a policy is: scenarios, metrics, comparison, report."""
