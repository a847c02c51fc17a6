"""One frozen dataclass per node: its fields are the ROS parameters, checked when it is made."""
