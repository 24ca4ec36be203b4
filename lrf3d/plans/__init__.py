"""Floor plans from drawings and pictures: which strokes are walls.

An item of a file is painted as marks; marks that touch are merged into pieces, and pieces are cut
into lines, whose segments are the strokes that rules judge; a part is a stroke that a plan keeps or
leaves out, with its kind.
"""
