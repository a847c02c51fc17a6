"""Offline package: recordings, identification, diagnosis, training, evaluation, reports."""
