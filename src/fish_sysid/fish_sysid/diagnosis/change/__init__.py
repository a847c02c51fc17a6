"""What changed between recordings of one robot, although the model of it is wrong."""
