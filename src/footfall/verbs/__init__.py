"""The verbs, one file each. A verb imports its rooms only when it runs."""
