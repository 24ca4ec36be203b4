"""The studio: scenes, films, pages, 3D files and figures of runs."""
