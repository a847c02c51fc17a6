"""Starts the robot: node table, process starter, launch files, demo, score, excite."""
