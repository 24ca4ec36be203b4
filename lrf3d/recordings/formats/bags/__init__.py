"""ROS bags: files, transforms, poses, messages."""
