"""What decides: the contract, learned policies, hand-written controllers, the zoo."""
