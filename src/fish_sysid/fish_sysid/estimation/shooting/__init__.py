"""Multiple shooting: windows of measurements, each with a start state of its own that the fit eliminates."""
