"""The fish as a picture: its joint angles for robot_state_publisher."""
