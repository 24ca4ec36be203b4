"""ROS messages as dicts, for bags and for live robots."""
