"""Tuning constants of the default mapper for glass and mirrors, in scans with intensities.

Each has its unit and its reason, as those of walls in `constants`.
"""

import numpy as np

# --- Glass, in scans with intensities ---

USUAL_SHARE = 0.7
"""[share] The usual brightness of a return, its intensity times the square of its range, is that
which so many have at most: beside a front of glass most are dim."""

BRIGHTNESSES, STEPS_AN_OCTAVE = 512, 4
"""[steps] Steps in which brightness is counted, in all and for each factor of two."""

FLASH_SHARE = 5.0
"""[share] A return is a flash where its brightness is so many times the usual one. Diffuse
walls reach about 3 at most; glass some hundreds."""

DIM_SHARE = 0.04
"""[share] A return is dim where its brightness is less than this part of the usual one: glass
returns about a hundredth. More takes dark cloth for glass until nothing is seen behind it."""

FLASH_DEVIATION = np.radians(0.6)
"""[rad] How far off the normal a flash may be: half of the step between two beams of common range
finders, and of the lobe of glass."""

LONGEST_PAIRED = 4
"""[beams] Longest run of dim returns of which each two that follow each other are taken for a part
of a pane: of longer ones a wall is found."""

FLASH_COSINE = np.cos(np.radians(5.0))
"""[cosine] Smallest incidence at which glass may flash."""

PANE_DISTANCE = 0.1
"""[m] How far off a pane a return of it may lie, beside what noise explains: as walls."""

PANE_DEVIATIONS = 3.0
"""[deviations] The same for its place and its direction, as these are known."""

PANE_DEPTH = 0.3
"""[m] A beam that goes no farther than this behind a pane does not pass it."""

PANE_GRAZING_COSINE = 0.26
"""[cosine] Beams at 75° and more from the normal are mirrored as much as they pass."""

PANE_PIECE = 0.25
"""[m] Length of a piece of a pane, in which beams are counted."""

PANE_PIECES = 256
"""[pieces] How many pieces a pane may have: 64 m."""

PANE_GAP = 25.0
"""[m] Longest gap between two returns of one pane where no beam ends on something opaque. Between
two places from which a robot met a pane at a right angle it returned nothing."""

FRAME_DISTANCE, FRAME_SINE = 0.3, 0.3
"""[m, sine] A wall meets the line of a pane where it ends so near it or crosses it, no flatter."""

LEAST_SHOWN = 3
"""[beams] A pane is glass where at least so many beams returned light as glass does or passed …"""

DIM_CELL, MOST_DIM = 0.1, 20_000
"""[m, returns] Single dim returns are kept one in a cell of this size, and at most this number of
them: 1 MB. It does not matter which of them, as they only show where a pane is."""

OPEN_COSINE, OPEN_DEVIATION = np.cos(np.radians(0.4)), np.radians(0.2)
"""[cosine, rad] A beam that passes so near the normal, of a line whose direction is so well known,
shows that no glass is there: it would have flashed."""

OPAQUE_SHARE = 0.3
"""[share] … and those that ended on it, neither bright nor dim, are fewer than this part."""

ABSORBED, ABSORBED_DISTANCE, ABSORBED_SINE = 0.5, 0.2, 0.15
"""[share, m, sine] A segment of the map is a part of a pane where so much of its length lies by it,
no farther off and no more askew."""

PANE_JOINS = 0.4
"""[m] A pane is of the object of a wall whose end it reaches so nearly."""

PANE_INDEX = 1.52
"""Refractive index of panes: that of window glass. Others are between 1.5 and 1.6."""

IMAGE_LIGHT = 3.0
"""[factor] How much an image in a pane may differ in light from what Fresnel's equations say: panes
on the way take up to a half, and of the reflectance of walls only the mean is known."""

# --- Mirrors, in scans with intensities ---

PARALLEL_SINE = 0.2
"""[sine] Twice the sine of half the angle between two walls of which one may be the other's image:
walls at right angles to the mirror go on in theirs, and do not say where it is."""

MIRROR_DEPTH = 0.2
"""[m] How far behind a mirror an image lies at least."""

IMAGE_DISTANCE = 0.15
"""[m] How far off a wall an image may lie when it is mirrored back, beside what noise explains."""

IMAGE_SHARE = 0.85
"""[share] How many returns behind a mirror are images at least: others are of things that the map
does not show yet."""

LEAST_IMAGES = 12
"""[beams] Images in a scan by which it shows a mirror at least."""

DIFFERENT_SINE = 0.3
"""[sine] A scan shows a mirror by images of walls that turn by more than this."""

MIRROR_SCANS = 4
"""[scans] A line is a mirror where so many show it."""

MIRROR_ANGLE = np.radians(2.0)
"""[rad] Two lines nearer than this, and as near as images lie, are one mirror."""

MIRROR_LIGHT = (0.6, 0.97)
"""[share] How bright images are beside what they are of: two walls of which one is darker are no
images of each other, and a symmetrical room is as bright on both sides."""

LIGHT_DEVIATION = 0.08
"""[share] How far this may differ from image to image."""

MOST_MIRROR_LINES = 6
"""[lines] How many lines of a scan are looked at, those first that most pairs of walls agree on."""

LIGHT_CELL = 0.25
"""[m] Size of a cell in which the reflectance of walls is kept."""

LEAST_COSINE = 0.2
"""[cosine] Returns at a smaller incidence say nothing of the reflectance."""

STRAY_WINDOW = 0.3
"""[m] How far the window of a mirror goes beyond all but two in a hundred of the images in it."""

SHORTEST_PANE = 0.5
"""[m] Glass is shown from this length on: shorter pieces are where the lines of others cross it."""
