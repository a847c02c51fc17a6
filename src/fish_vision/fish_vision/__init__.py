"""Overhead-camera tracker: calibration, HSV segmentation, markers to pose."""
