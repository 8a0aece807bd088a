"""What all other packages stand on: errors, configuration, files, outputs, rotations, versions."""
