"""Predictions over seconds and baselines."""
