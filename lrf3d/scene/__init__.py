"""What is to be seen of a run, once for all pictures of it.

A run or a world enters; plain arrays and values leave: walls and the ground, when the laser first
met them, the robot and dynamic obstacles, beams, trail and map, and the constants of the look. They
are drawn with OpenGL and with Embree by :mod:`lrf3d.render`, and written as glTF, which the page of
:mod:`lrf3d.view` also shows, by :mod:`lrf3d.gltf`.
"""
