"""Training of the controller's gains, and evaluation of how well they follow paths."""
