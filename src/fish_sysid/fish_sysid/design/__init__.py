"""Design of experiments: what a swim would say of a robot, before anybody swims it."""
