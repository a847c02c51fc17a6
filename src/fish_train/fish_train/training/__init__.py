"""Learning the controller's gains through the simulator."""
