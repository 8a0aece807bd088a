"""What a log tells of its run."""
