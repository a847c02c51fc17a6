"""Kalman fusion, reference paths, line-of-sight planner and PID with learned gains."""
