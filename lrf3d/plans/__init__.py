"""Floor plans from drawings and pictures: which strokes are walls."""
