"""Who steers and who looks: command sources, and what they share."""
