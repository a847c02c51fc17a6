"""Identification: trials to parameters with uncertainties."""
