"""Glass and mirrors of a robust map, from the light of scans with intensities."""
