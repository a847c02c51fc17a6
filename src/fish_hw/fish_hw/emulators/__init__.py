"""Devices made of software, for tests and for trying the nodes with no hardware."""
