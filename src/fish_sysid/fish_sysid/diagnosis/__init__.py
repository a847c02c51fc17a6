"""Diagnosis: where recordings and model differ, which physics is missing, how sure that is."""
