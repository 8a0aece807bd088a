"""What the machine is: description, motor law, kinematics."""
