"""Commands of this package for `robofish`, one module each."""
