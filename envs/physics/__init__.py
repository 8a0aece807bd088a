"""How the bodies move through a control step: one interface and the engines behind it."""
