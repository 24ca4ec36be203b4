"""The visible content of a run, as plain arrays and values, once for all pictures of it.

They are drawn with OpenGL and with Embree by :mod:`lrf3d.render`, and written as glTF by
:mod:`lrf3d.gltf`; the page of :mod:`lrf3d.view` is sent them.
"""
