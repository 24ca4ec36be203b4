"""Drawing a run: films with pyrender, figures with matplotlib."""
