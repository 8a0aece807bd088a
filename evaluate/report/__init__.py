"""A comparison as one HTML page with films and plots. This package alone needs the extra `report`."""
