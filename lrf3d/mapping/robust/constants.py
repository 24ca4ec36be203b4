"""All tuning constants of the default mapper, in the order in which a scan meets them.

Each has its unit and its reason, and says what less or more of it does where that is known. The
settings that users choose are arguments of :class:`lrf3d.LineMapper`. Lengths are in metres; a
deviation is one standard deviation of a range under the noise model, so that what is counted in
deviations follows the noise and needs no tuning for another range finder.
"""

import numpy as np

# --- Extraction: clusters of returns ---

GRAZING_ANGLE = np.radians(8.0)
"""[rad] Walls met at a smaller angle than this cannot be told from a gap any more."""

CLUSTER_DEVIATIONS = 4.0
"""[deviations] How much farther apart than the beams' spacing allows two returns of a cluster may
lie: the noise of both is added to the gap."""

# --- Extraction: the division of a cluster into walls ---

WALL_COST = 20.0
"""[χ²] Cost of a further wall: noise on one wall of some hundred points, divided at its best place,
gains less than this but once in thousands of times. The refit of the map's walls uses it too."""

OUTLIER_COST = 12.0
"""[χ²] Cost of a point on no wall: as much as one 3.5 standard deviations off."""

LEAST_POINTS = 3
"""[points] Fewest points of a wall: two fit any line."""

PRUNED_COST = max(0.0, (LEAST_POINTS - 1) * OUTLIER_COST - WALL_COST)
"""[χ²] How much worse than the best a division may be and still lead to a better one later: what
the points behind it could cost that are too few for a wall of their own. Exact: no tuning."""

MOST_OPEN = 256
"""[places] Most places where a wall may still begin that are weighed for a point, so that the work
grows with the points and not with their square. On a wall all of its points stay such places. On
walls of more points the older half is thinned out, and a wall may then begin a few of many beams
beside its corner; with 1024 maps from scans of 721 beams are the same, and 50,000 beams take three
times as long."""

# --- Extraction: segments of a scan's walls ---

LEAST_INCIDENCE = 0.05
"""[cosine] Smallest incidence that a weight is computed with: along grazing beams other errors than
that of the range decide. Weights of returns on walls of the map use it too."""

WEAKEST_DIRECTION = 0.15
"""[rad] A segment whose direction is known to no better than this is not taken into the map."""

END_DEVIATIONS = 5.0
"""[deviations] How far a noisy end is moved along its beam onto its wall at most: a beam that all
but runs along the wall would carry it far off."""

SCAN_CORNER_SINE = 0.2
"""[sine] Turn below which two neighbouring walls of a scan have no corner: their lines cross at an
arbitrary place."""

SCAN_CORNER_BEAMS = 3
"""[beams] How many beams apart two walls of a scan may end and still share a corner."""

SCAN_CORNER_STEPS = 1.5
"""[steps] How far the corner may lie from the two ends, as a multiple of how far they lie apart."""

SCAN_CORNER_DEVIATIONS = 4.0
"""[deviations] What the noise adds to how far the two ends lie apart."""

# --- Merging: which two segments are one wall ---

SAME_DIRECTION = 0.5
"""[cosine] Largest angle between two segments that may be one wall. Far more than noise explains;
the offsets of the ends decide."""

MERGE_DEVIATIONS = 3.0
"""[deviations] How many standard deviations of its place a segment may lie beside a wall."""

BEND = 0.4
"""[share of merge_distance] How far a wall may bend where it is continued: two views of a wall
differ by the error of the poses, but next to each other they share it. More bridges slight
bends of a wall into one."""

MOST_EXPLAINED = 1.0
"""[m] Largest offset that noise may explain when walls are merged: a short far segment explains
almost any."""

MERGE_CELL = 4.0
"""[m] Size of a cell of the grid that finds partners: a few of the reach of merging and a fraction
of a wall. It changes speed only."""

# --- Evidence: what beams have shown of the ground ---

LOSS_ODDS = 0.01
"""[odds] A gap in a scan that lost beams leave by no more than such a chance is a real one."""

LEAST_LOST, MOST_LOST = 2, 8
"""[beams] How many beams beside each other may be lost at least, also where hardly any are, and at
most. More forgets what is seen through narrow gaps, less takes lost beams for gaps of walls."""

CELL = 0.1
"""[m] Size of a cell. What is kept of the ground grows with its square; at 0.2 the purity of the
objects of a town falls by 0.05."""

PASS_DIRECTIONS = 16
"""[directions] By how many directions the beams through a cell are told apart: those that run
along a wall do not violate it. Eight serve as well but for narrow lanes."""

HIT_DIRECTIONS = 8
"""[directions] By how many directions returns are told apart: thin walls are seen from both sides,
and at a corner two walls share a cell."""

MOST_PASSES = 127
"""[beams] When more have gone through a cell one way, all that is kept of the cell is halved: what
came later counts more, so that a wall that goes away, or comes, is noticed after some hundred
beams whatever was before. Seven bits: the eighth marks cells with returns."""

MOST_HITS = 255.0
"""[beams] The same for the returns in a cell from one direction."""

GONE_AFTER = 20
"""[beams] When so many have gone on where others ended, the same way and without a hit between
them, what stood there is gone. Less forgets panes and fences that one beam in so many hits."""

LEAST_HITS = 0.5
"""[beams] What fewer hits than this are left of is forgotten altogether."""

SAME_WAY = 0.7
"""[cosine] Angle between beams that go the same way."""

WALL_SINE = 0.5
"""[sine] Angle from which on a beam through a cell of a wall crosses it: at less it may run before
the wall as well, in the same cells."""

LINK_SINE = 0.35
"""[sine] The same for a link between two walls, which no beam need run along."""

# --- Choice of walls: which are refined again ---

FRESH_SHARE = 0.1
"""[share] A wall is refined again when this part of what it was refit by has come anew. Less
takes time, more leaves walls behind what is known of them."""

STALE_SHARE = 0.05
"""[share] The same for the one wall that has waited longest, after scans that changed few."""

FEW_WALLS = 2
"""[walls] How many walls are few."""

MOVED = 0.01
"""[m] A wall is refined again when its line has moved by this …"""

GROWN = 0.1
"""[m] … or it has become longer by this."""

UNCHANGED = 0.15
"""[m] A segment that lies no farther than this from where it was linked with others keeps its
links. Its ends move by whole pieces of 0.1 m. Less takes time …"""

NEW_POINTS = 1.3
"""[share] … but the beams are asked again about those that they have not crossed when its points
are this many times as many as when they were."""

# --- Refinement: hits and free-space violations ---

PIECE = 0.1
"""[m] Length of a piece of a wall, within which its evidence is counted."""

FOLLOWED = 2.0
"""[m] How far a wall is followed beyond what single scans showed of it, to what single beams
hit."""

FREE_DEPTH = 0.2
"""[m] A beam that goes no farther than this behind a wall is no free-space violation: poses and
edges are a little wrong."""

HIT_DEVIATIONS = 3.0
"""[deviations] What the noise adds to how far a return may lie off a wall that its beam hit, and
how far a beam must go on behind a wall to violate it."""

CONTINUATION_STRICTNESS = 0.5
"""[share] How far off a return may lie that makes a wall longer, as a part of what is usual."""

CONTINUATION_PENALTY = 2.0
"""[share] By how much of what is usual a return counts as farther off a wall that it would make
longer, so that walls that were seen there come first."""

DEEPEST_HIT = 5.0
"""[share] How far a hit may lie from the wall along its beam, as a multiple of how far it may lie
off: beams that all but run along a wall hit it anywhere."""

SPREAD_FACTOR = 16.0
"""[share] How many times the variance of the noise returns may be spread across a wall in a cell
and still be of that wall alone: four standard deviations. At 4 walls of rooms are a fifth nearer to
the truth, and a map of an office explains 0.1 % less of its returns."""

# --- Refinement: refitting the segments of a wall ---

VIOLATION_WEIGHT = 0.01
"""[hits] What a free-space violation weighs against a hit where both take turns: poses and edges
are a little wrong, and beams miss thin legs, so a wall that one beam in a hundred hit is still more
than nothing. At 0.04 maps of cluttered offices explain 0.5 % less of the returns."""

TRANSIENT_WEIGHT = 0.16
"""[scans] What it weighs against a scan that hit, where hits and violations do not take turns, as
what moves leaves them: it is hit in few scans, from near by many beams of each. More takes what
robots saw only in passing out of maps of offices, less leaves more of the trails of people …"""

TAKEN_TURNS = 0.3
"""[share] … and they take turns where for each scan that hit so many beams went through before the
next one did. More takes legs of furniture out, less keeps more of slow obstacles."""

TURNS_SHARE = 0.1
"""[share] They take turns only if at least this share of the violations came between two scans that
hit, and not before the first or after the last. Without it slow obstacles leave half as many false
walls more; of short walls of furniture one in ten has less."""

SETTLED_AFTER = 30
"""[scans] What was free before, and then was hit by scans so far apart, has come to stay, as a door
that closed: what went through before counts no more. Less keeps the last that was seen of who walks
slowly, more forgets doors for longer …"""

CAME_BEAMS, CAME_SCANS = 8.0, 1.0
"""[beams] … and what is shorter than SHORT_WALL, was hit for less than that, and was gone through
before by more beams than this, and than this for each scan that hit, has not. At 20 beams and 3
more of slow obstacles stays; at 5 and 0.5 a map of an office explains 0.1 % less of its returns."""

FORSAKEN = 4.0
"""[share] A wall without a real part is given up, and found anew if it comes back, where its
violations outweigh its hits by this. Less takes time to find weak walls again and again."""

OPEN_WEIGHT = 0.5
"""[hits] What a free-space violation weighs at a piece without hits, and as new
evidence of a wall."""

DUPLICATE_WEIGHT = 0.2
"""[hits] What a beam weighs that hit another wall more nearly: a second copy of a wall is not
kept."""

END_SPARE = 0.04
"""[m] How far a wall goes on beyond its last hit where no beam went through beyond: about half of
the distance between two beams. More explains more returns at corners, and hides more of what is
seen beside the ends."""

UNSEEN_COST = 0.1
"""[hits] Cost of each piece of wall, so that walls end where their hits do."""

CHANGE_COST = 5.0
"""[hits] Cost of a gap's begin and of its end: less would cut walls for stray beams."""

MAP_DEVIATION = 0.025
"""[m] No piece of a map is known better than this, however many beams hit it: what they share, the
errors of poses, does not average out. Less divides straight walls, more straightens bent ones."""

LEAST_SPREAD = 0.01
"""[m²] Mean square spread of its points along a wall below which a segment keeps the wall's
direction: shorter ones know none."""

SHORT_WALL = 0.5
"""[m] Walls shorter than this need twice min_points hits, and twice the violations' weight of them:
clutter, and what moves, makes short ones of any few returns."""

# --- Refinement: gaps that are bridged and corners that are closed ---

LONGEST_GAP = 3.0
"""[m] Longest gap of a wall that is bridged where no beam crossed it: behind a longer one there may
as well be a recess that beams could not look into."""

CORNER_REACH = 0.3
"""[m] Two walls meet where their lines cross no farther than this from an end of each."""

CORNER_TRIM = 0.1
"""[m] An end is taken back to a corner by no more than this: beams hit the wall beyond it."""

CORNER_SINE = 0.25
"""[sine] Turn below which two walls have no corner: their lines cross at an arbitrary place."""

# --- Object association: links between walls ---

TOUCH = 0.1
"""[m] Walls that come nearer than this touch: no beam between them need be trusted."""

ABUTS = 0.5
"""[m] Longest link that may run before a wall which goes on to both sides of it: what abuts on it
is seen up to almost there, and what is seen no nearer merely stands before it."""

ABUTS_SIDE = 0.3
"""[m] How far a wall reaches beside a link if it goes on there."""

FACING = 1.0
"""[m] Longest link between the faces of two walls, across a niche: where such walls are farther
apart, a bottom that joins them is wide enough to be seen."""

FACING_SINE = 0.5
"""[sine] Angle by which a link runs before a wall that it leads to the face of."""

SHORT_LINK = 3.0
"""[m] Longest link that may run before a wall: less than a lane between buildings. More joins
buildings across lanes, less leaves corners of a building apart."""

HIDDEN_LINK = 4.0
"""[m] Longest link along which a wall may go on, unseen, to the face of another: a corner that
something hid."""

HIDDEN_SINE = 0.1
"""[sine] Angle by which such a link may stray before the wall that it continues."""

LONGEST_LINK = 15.0
"""[m] Longest link behind two walls: as deep as most buildings are."""

MOST_LINKS = 24
"""[links] How many others a new wall is linked with, the nearest ones."""

BEHIND_SINE = 0.3
"""[sine] Angle by which a link may run before a wall and still count as behind it."""

LINK_DEVIATIONS = 2.0 * HIT_DEVIATIONS
"""[deviations] How far the end of a wall and the face before it may be off together."""

LINK_END = 1.5 * CELL
"""[m] How much of a link's ends is left out: beams that go by the end of a wall, through the same
cells, go on as far as they like."""

STRAY_BEAMS = 1
"""[beams] How many may cross a short link: noise that lets one through is rare, but links are
many."""

CORNER_BEAMS = 8
"""[beams] How many may reach into the corner behind a short link: by more the corner was seen, and
what joins there was seen too."""

NICHE_DEPTH = 0.5
"""[share] How deep such a corner may be, as a part of the link's length."""

LINKS_A_TURN = 8
"""[links] How many links that hold objects together an update checks again, for beams that have
crossed them since. It changes how soon objects come apart that are two."""

SLOTS_A_TURN = 1024
"""[links] Among how many it looks for them, so that the cost of an update has a bound."""

SIGHT_PLACES = (0.1, 0.5, 0.9)
"""[share] Where on two walls the lines of sight between them begin and end, as parts of their
lengths."""

SEVERAL_WALLS = 3
"""[walls] From this number of walls on, an object is joined to another such by two long links."""

SECOND_LINK = 1.0
"""[m] How much longer the second of the two may be: a much longer one leads past more walls."""

# --- The noise that scans show ---

NOISE_RANGES = np.geomspace(0.1, 200.0, 13)
"""[m] The ranges between which noise is measured together: steps of a factor of two. It changes
little: noise is fitted to all of them."""

NOISE_UNIT = 1e-5
"""[m] The smallest noise that is told from none."""

NOISE_WIDEST = np.radians(6.0)
"""[rad] Farthest apart of two beams that follow each other on a wall: several lost beams of common
range finders. Wider, walls end in between more often; narrower, few beams show nothing."""

NOISE_SLOPE = 6.0
"""Steepest change of the range along a wall, as a share for each radian: walls met at 10° or more.
Steeper ones magnify noise, and jumps from wall to wall hide among them."""

NOISE_JUMP = 5.0
"""[deviations] How much noise may add to that, by what is known of it so far."""

NOISE_SHARE = 0.05
"""Largest noise, as a share of the range, that may add to that: were it more, a noise that is given
far too large would take corners for noise and never be put right."""

NOISE_PRIOR = 50.0
"""How many ranges the noise that is given counts as: a third of a scan. It matters for the first
scans only."""

NOISE_STEPS = 1.2
"""By which factor more must be known before noise is fitted anew. It changes speed, and the error
of the noise by a few per cent."""
