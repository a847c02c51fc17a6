"""System identification and diagnosis: fits the robot's parameters and names the physics that its model lacks."""
