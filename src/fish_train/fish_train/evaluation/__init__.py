"""How well gains follow paths: on any plant, with perfect or realistic sensing."""
