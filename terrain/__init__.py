"""The ground that robots walk on: height and slope as functions of position, shapes, height maps."""
