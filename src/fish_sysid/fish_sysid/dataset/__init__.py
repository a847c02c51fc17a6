"""Recordings as an experiment: trials on one time grid."""
