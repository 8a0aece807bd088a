"""The robot: its description, joint law and kinematics."""
