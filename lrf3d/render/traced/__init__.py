"""Drawing without OpenGL: Embree says what each pixel sees, compiled code shades it.

The scene, the cameras, the panels and the order of drawing are those of the film; only the
renderer is another. Its shading follows ``render/shaders`` line by line, and a test compares the
pictures of both.
"""
