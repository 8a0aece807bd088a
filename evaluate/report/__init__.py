"""A comparison as one HTML page with films and plots. This room alone needs the extra `report`."""
