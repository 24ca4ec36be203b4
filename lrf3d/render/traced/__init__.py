"""Drawing without OpenGL: Embree finds what each pixel sees, compiled code colours it.

The scene, the cameras, the panels and the order of drawing are those of the film; only the
renderer is another. Its shading follows ``render/shaders`` line by line, and a test compares the
pictures of both.
"""
