"""Commands of the tracker's package."""
