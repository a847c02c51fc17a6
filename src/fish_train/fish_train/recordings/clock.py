"""Offset and drift of one machine's clock against another's, from arrival times and stamps."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ClockEstimate:
    """How the clock of some topics' stamps stands against the recorder's.

        recorder = stamp + offset + drift (stamp - middle),  offset known up to the shortest latency

    Arrival minus stamp is offset plus latency; latency is not negative, so the lower envelope is the offset plus the
    shortest latency on the way. `offset_s` is that envelope: the true offset is at most so much, and less by the
    shortest latency, which no recording can tell.
    """

    clock: str  # name from the topic map
    topics: tuple[str, ...]  # whose stamps it was estimated from
    offset_s: float  # at the middle of the recording
    offset_std_s: float
    drift_ppm: float
    drift_std_ppm: float
    applied: bool  # whether the stamps were moved by it
