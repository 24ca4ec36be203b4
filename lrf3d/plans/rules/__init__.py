"""Rules that decide which strokes of a drawing or pixels of a picture are walls."""
