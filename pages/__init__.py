"""A page that shows a run's newest policy walking beside the run's curves. It reads the run folder only."""
