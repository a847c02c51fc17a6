"""The differentiable simulator of a rotor-driven robot fish, its sensors and the rendered pool."""
