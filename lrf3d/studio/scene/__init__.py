"""The visible content of a run, as plain arrays and values, once for all pictures of it.

They are drawn with OpenGL and with Embree by :mod:`lrf3d.studio.render`, and written as glTF by
:mod:`lrf3d.studio.gltf`; the page of :mod:`lrf3d.studio.page` is sent them.
"""
