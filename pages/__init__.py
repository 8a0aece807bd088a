"""Pages in the browser: a run's newest policy with its curves, a live run in 3-D, and the cockpit."""
