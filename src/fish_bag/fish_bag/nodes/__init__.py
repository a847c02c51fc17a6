"""ROS 2 nodes: parameters, messages and one call into the core each."""
