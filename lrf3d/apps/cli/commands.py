"""The commands, each in the words of its help page, after which its words are parsed.

A text has paragraphs, and lists that may begin with a title. A line of a list is an argument or an
option: its names, what it takes, its default and its help. What an option takes says how it is
read: ``N`` is a whole number from 1, ``M`` a length [m], ``a|b`` a choice, and ``M,M,…`` a list.
"""

from lrf3d.base.formats import by_name, endings, of_kind


def either(names: tuple[str, ...]) -> str:
    """Names as a list of alternatives: ``a, b or c``."""
    return " or ".join(filter(None, [", ".join(names[:-1]), names[-1]]))


# The endings of the files that a world is written to.
WRITTEN = either(endings("world", written=True))

WORLD = "WORLD: A built-in world, or a world file; ./NAME is a file named like a built-in world."
RUN = "RUN: A run.npz, or its folder."
FORCED = "--force: Replace the results of another run that the folder holds."
FORCED_FILE = "--force: Replace a file that was made from other sources, or edited."
OUT = f"""\
-o --out FOLDER: Folder for the results; out/NAME if not given, where NAME is the name in the file
 or else of the file, with _map for the map of a run and _sweep for a sweep.
{FORCED}"""
SEED = "--seed SEED = 0: Seed; the same seed gives the same results."
SCALE = """\
--scale FACTOR = 1.0: Enlarge the plan and its route, not the heights: 100 for a drawing of 1:100,
 0.001 for millimetres that were read as metres."""
THRESHOLD = """\
--threshold GREY: Grey from which on pixels of a bare picture, or of a scanned PDF page, are paper,
 below 255 (white); found if not given."""
RESOLUTION = f"--resolution M: Side of a pixel [m], if the world is a bare picture.\n{THRESHOLD}"
LAYERS = """\
--page N: Page of a PDF file; 1 if not given.
--layers LAYER,LAYER,…: Layers of a drawing that are walls, such as A-WALL*; found by their names if
 not given.
--without LAYER,LAYER,…: Layers of a drawing to leave out.
--cut M: Height above its floor at which a mesh is cut [m]; 0.5 if not given.
--level LEVEL: Level of indoor rooms in .osm and .geojson; the ground floor if not given.
--edits FILE: Decisions about a plan, written by lrf3d edit; FILE.edit.toml next to the plan if not
 given."""
TREES = "--trees: Make walls of the trunks of trees in a .osm file, too."
ROUTE = """\
--inside: Plan the route inside the walls, if the world has none; if not given, the world decides.
--outside: Plan it outside the walls.
--ignore-collisions: Only warn if the robot hits a wall."""
MODE = "--mode robust|paper: Mode of the mapper."
# What a log may be, besides arrays.
TEXT_OR_BAG = f"""\
A CARMEN log or a text of a scan a line, also gzipped, a ROS bag
 ({", ".join(by_name("log", "bag").endings)}, a folder)"""
ARRAYS = f"arrays ({', '.join(by_name('log', 'arrays').endings)})"
LOG = """\
--largest-range M: Readings [m] of this or more mean no return.
--smallest-range M: Readings [m] of this or less are left out, such as those of the robot itself.
--mask FROM:TO,…: Bearings [degrees] that are left out, counter-clockwise from ahead.
--scan-topic TOPIC: Bags: topic of the scans; all lasers of the robot of /scan if not given.
--height LOW,HIGH: Bags: make scans of the points of clouds between these heights [m].
--format FORMAT: Text: its columns, such as
 stamp:us,x,y,theta,ranges:mm@25,first=-90deg,last=90deg; found if not given.
--part N: Bags whose stamps go back: the part that is read; the longest one if not given."""
REPAIRS = """\
--without-repair REPAIR,…: Leave out repairs of the log: no_return, angles, body, copies, stamps,
 jumps, standing, fan, mirror, lag, mount, sweep."""
WORKERS = "--workers PROCESSES: Number of processes; one for each core if not given."
DRIVE = f"""\
World and drive:
--set TABLE.KEY=VALUE: Override a key of the world file; repeatable.
{SCALE}
{RESOLUTION}
{LAYERS}
{ROUTE}"""
FILM = f"""\
Film:
--view CAMERA: Camera: story, chase, first, orbit, overview, top, or one of the world.
--size WxH: Size [pixels]; 1280x720, but 640x360 for .webp and with Embree, 416x234 for .gif.
--fps RATE: Frames per second; 25, but 12.5 for .webp and 8 for .gif.
--playback SPEED: Simulated seconds per second of film.
--length S: Approximate length of the film [s]; 15 for a story if not given.
--samples 0|1|4 = 1: Samples per pixel: 1 with smoothed edges, 4, or 0 for one with jagged edges.
{WORKERS}
--renderer gl|embree: Renderer; embree needs no OpenGL. The best available if not given.
--panel short|full = short: Text of the panel: three facts, or all numbers."""

# A list that all commands have.
OUTPUT = """\
Output:
--json: Print one JSON object and nothing else.
-q --quiet: Print no summary, notes and progress.
-v --verbose: Print all figures, too, as JSON.
-h --help: Show this page and exit."""

COMMANDS = {
    "run": f"""\
Drive through a world, scan it, map it, and draw the results.

Writes run.npz, map.geojson, map.png, world.png, summary.json and run.mp4. MODULE:OBJECT is imported
from a file, the current folder or the installed modules.

{WORLD}
{OUT}
--sigma M,M,…: Noise [m] at range_max; of several, maps are compared in a figure.
{MODE}
--slam: Map without true poses: from the scans and wheels that slip and drift.
{SEED}
--caster embree|planar = embree: Caster of the beams.
--scans N: Number of scans; the route is driven there and back until then.
--resume: Continue this run where it was stopped.
--robots N = 1: Number of robots, which start spread along the route and see each other, with a
 folder each; the film follows the first, with up to three maps.
--video = yes: Make the film.

{DRIVE}

Your own algorithms:
--mapper MODULE:OBJECT: Your mapper: update(scan).
--controller MODULE:OBJECT: Your controller: command(time, pose, scan) -> (v, w).
--noise MODULE:OBJECT: Your noise: noise(scan, rng).

{FILM}

Example: lrf3d run city --sigma 0.04 --out out/city""",
    "render": f"""\
Draw the film of a run, or a picture of one moment.

The ending of --out selects the kind.

{RUN}
-o --out FILE: The film: {either(endings("film"))}; with --at a .png; in the run's folder if not
 given.
{FORCED_FILE}
--at S: Draw one picture at this time [s] instead of a film.
--from S: Begin the film at this time of the run [s].
--to S: End the film at this time of the run [s].
--points-by range|intensity: What the colour of hit points shows; as in the run if not given.
--trajectory FILE: Show this estimate, a TUM file, next to the truth.

{FILM}

Example: lrf3d render out/city --view top""",
    "view": f"""\
Play a run in the browser, or drive through a world by hand.

In a world the arrow keys or the pads on the page drive the robot. Ctrl-C ends the server.

RUN|WORLD: A run.npz or its folder to play, or a world to drive in. A built-in world comes before a
 folder of the same name: write ./NAME for that.
--host HOST = 127.0.0.1: Address or name to listen at; 0.0.0.0 lets other machines in.
--port PORT: Port; if not given, 8080, or any where that is taken.
--browser = yes: Open the browser.
--foxglove: Serve a world to Foxglove or Lichtblick instead, at ws://HOST:8765 or PORT.
--playback SPEED: Simulated seconds per second.
{SEED}

{DRIVE}

Example: lrf3d view city""",
    "edit": f"""\
Correct a plan, or draw a new one, in the browser, and place a robot in it.

The page shows the drawing and the walls that were read from it. Corrections are kept in
FILE.edit.toml, which other commands apply. A new .toml is an empty sheet. Ctrl-C ends the server.

[FILE]: A drawing, a picture, a map, a world or a run, or a new world file; world.toml if not given.
--host HOST = 127.0.0.1: Address or name to listen at; 0.0.0.0 lets other machines in.
--port PORT: Port; if not given, 8080, or any free one if that is taken.
--browser = yes: Open the browser.
{SCALE}
{RESOLUTION}
{LAYERS}

Example: lrf3d edit flat.dxf""",
    "ros": f"""\
Serve a robot in ROS 2: other programs see its scans and drive it.

Topics: scan, odom, tf, tf_static, map, ground_truth and /clock; cmd_vel and set_pose are obeyed.
Services: pause, reset and step. Ctrl-C ends it. Words after --ros-args are for ROS, such as
-r scan:=base_scan.

{WORLD}
--rate RATE: Scans per second; that of the world file if not given.
--speed-up FACTOR = 1.0: Simulated seconds per second; 0 is as fast as it goes.
--give pose|map|none = pose: What is given of the truth: map and pose, the map alone, or nothing.
--wheels: Odometry of wheels that slip and drift; exact if not given.
--cmd-timeout S = 0.5: Stop if no command comes for this simulated time [s]; 0 means never.
--namespace NS: Namespace of the topics.
--robots N = 1: Number of robots; topics and frames of several begin with robot1, robot2, ….
--no-clock: Leave /clock to another program.
--no-odom-tf: Leave odom -> base_link and map -> odom to another program, such as a filter.
--commands both|Twist|TwistStamped = both: Type of cmd_vel.
--lines: Map while driving, and publish the line map as map_objects.
{SEED}

{DRIVE}

Example: lrf3d ros city --rate 10""",
    "score": f"""\
Score another program's trajectory and map of a run against the truth.

Absolute and relative errors are defined as in evo_ape and evo_rpe: poses are matched by their
stamps, and the trajectory is aligned with the true one, the map along with it.

Writes score.png and summary.json.

{RUN}
--trajectory FILE: The estimate, a TUM file: lines t x y z qx qy qz qw.
--map FILE: Its map: .geojson, .toml or the .yaml of a ROS map.
-o --out FOLDER: Folder for the results; the run's folder with _score if not given.
{FORCED}

Example: lrf3d score out/city --trajectory theirs.tum""",
    "export": f"""\
Write a run for another program.

carmen is a text log; mcap is a ROS 2 bag in one file, for Foxglove; rosbag2 is one as a folder, for
ros2 bag play, rviz and slam_toolbox; glb is an animated 3D scene for Blender and web viewers; html
is the page of lrf3d view in one file, which plays in any browser.

{RUN}
--to {"|".join(row.name for row in of_kind("export"))}: The format (required).
-o --out FILE: The file; in the run's folder if not given.
{FORCED_FILE}
--every N = 1: Keep every n-th scan, or moment of a page.

Example: lrf3d export out/city --to mcap""",
    "share": f"""\
Write a run as a single web page to send to others.

The page has up to 3 MB, opens without a server, and plays in any browser, also on phones.

{RUN}
-o --out FILE: The file, run.html in the run's folder if not given.
{FORCED_FILE}

Example: lrf3d share out/city""",
    "crosscheck": f"""\
Compare bare Embree in float32 with the exact ranges.

Each difference along a whole drive is classified by its cause. The exit status is 1 if one is
unexplained.

{WORLD}
-o --figure FILE: Draw the beams that differ to this .png.
{FORCED_FILE}

{DRIVE}

Example: lrf3d crosscheck city --json""",
    "map": f"""\
Map a log whose poses are known, and test the map.

The even scans build the map, the odd ones test it.

Writes map.geojson, map.png and summary.json.

LOG: {TEXT_OR_BAG}, {ARRAYS}, or a run.
{OUT}
{MODE}
--sigma M: Noise [m] of the ranges at the largest range.
--all: Build the map from all scans, without a test.
--poses auto|truth|tf|odom = auto: Source of the poses; auto takes the best that the log has.
{LOG}
{REPAIRS}

Example: lrf3d map drive.log.gz --out out/drive""",
    "degrade": f"""\
Degrade a recorded log on purpose, to test how robust a mapper or a SLAM is.

The scans, with their poses and the odometry, are written as a CARMEN log, which has no intensities
and no times of beams.

LOG: A log, as for map.
-o --out FILE: The log to write: {either(by_name("log", "CARMEN").endings)} (required).
{FORCED_FILE}
--drop SHARE = 0: Share of the returns that are lost, at random.
--noise M = 0: Standard deviation [m] of the noise that is added to each range.
--every N = 1: Keep every n-th scan.
--beams-every N = 1: Keep every n-th beam.
--seed SEED = 0: Seed; the same seed gives the same log.
--poses auto|truth|tf|odom: Source of the poses; those of a bag are its odometry if not given.
{LOG}

Example: lrf3d degrade drive.log.gz --drop 0.3 --noise 0.05 --every 2 --out worse.log.gz""",
    "slam": f"""\
Find poses and map of a log from odometry and scans.

Loops are closed; the systematic errors of the wheels, and the lag of the laser behind them, are
estimated.

Writes run.npz, map.geojson, map.png, trajectory.tum and summary.json; where the map contradicts
itself also check.png: the place as each pass saw it, and the closures that were refused.

LOG: {TEXT_OR_BAG}, or {ARRAYS}.
{OUT}
--on RUN: An earlier drive, a run.npz or its folder, that this one continues: it is found on its map
 without a guess, closes loops with it, and the results are those of both in one frame.
--relations FILE: Score by known relative poses: lines a b dx dy dtheta of ODOM lines.
--close A:B,A:B,…: Scans, by number, of which you know that they show the same place.
--not A:B,A:B,…: Scans of which you know that they do not, though they look alike.
--key-distance M: Distance [m] from one key scan to the next; 0.5 if not given.
--video: Make the film, run.mp4, too.
{LOG}
{REPAIRS}

{FILM}

Example: lrf3d slam drive.log.gz --out out/drive""",
    "localise": f"""\
Localise a recorded drive on a known map, without a first pose; or score simulated drives.

With a LOG, places are kept as hypotheses until one is left; that the robot is nowhere on the map is
one, too. Writes map.png, trajectory.tum of the scans whose places are known, and summary.json.

Without one, a filter of lines follows simulated drives from known starts.

MAP|WORLD: The map: a run.npz or its folder, as of lrf3d slam, a ROS map, a plan or a world.
[LOG]: A log, as for slam.
{OUT}
{LOG}
{REPAIRS}

Simulated drives:
--known walls|map = walls: The known map: the true walls, or the map of a first run.
--strategy seen-objects-first|all = seen-objects-first: Which known lines are compared with those
 of a scan.
--seeds N = 10: Number of drives, each with its own noise.
--sigma M: Noise [m] at range_max.
--position M = 0.1: Odometry noise [m] per step, ahead and sideways.
--heading DEG = 2.0: Odometry noise [deg] per step.
{WORKERS}

{DRIVE}

Example: lrf3d localise out/first drive.log.gz""",
    "sweep": f"""\
Compare mappers over worlds, noises, settings and seeds.

Each result is saved as it comes; --resume continues a sweep that was stopped, with the same
results. Writes runs.csv, summary.json, means.csv, means.tex and a figure for each world and
setting.

WORLD...: Built-in worlds or world files.
{OUT}
--sigma M,M,…: Noise levels [m] at range_max; six from 0.01 to 0.63 if not given.
--beams N,N,…: Numbers of beams.
--mapper NAME,NAME,…: robust, paper, or your own as FILE.py:NAME; robust,paper if not given.
--vary TABLE.KEY=V,V,…: Values for any key of world files; repeatable.
--seeds N = 20: Number of seeds for each setting.
--scheduler tcp://HOST:PORT: A Dask scheduler instead of this machine.
{WORKERS}
--shard I/N: Make only the runs of job I of N, such as 2/8.
--merge: Make no runs; collect those of all jobs in the folder.
--resume: Keep the runs in the folder and do the missing ones.
{ROUTE}

Example: lrf3d sweep city --sigma 0.04,0.42 --beams 91,181 --seeds 20""",
    "world show": f"""\
Describe a world, and draw it.

[WORLD]: A world; lists the built-in ones if not given.
-o --out FILE: Draw the world to this .png.
{FORCED_FILE}
{SCALE}
{RESOLUTION}
{LAYERS}
{TREES}

Example: lrf3d world show city --out city.png""",
    "world convert": f"""\
Read a world from one format and write it in another.

FROM: A built-in world, or a file.
TO: The file to write: {WRITTEN}.
{FORCED_FILE}
{SCALE}
--resolution M: Side of a cell [m] of a ROS map (0.05), or of a pixel of a bare picture.
{THRESHOLD}
{LAYERS}
{TREES}

Example: lrf3d world convert plan.dxf plan.toml""",
    "world generate": f"""\
Generate a world that a robot can drive in.

KIND city|maze|office|rooms: Kind of world: city, maze, office or rooms.
-o --out FILE: The file to write: {WRITTEN} (required).
{FORCED_FILE}
{SEED}
--size M: Approximate width [m]; depends on the kind if not given.

Example: lrf3d world generate maze --seed 7 --out maze.toml""",
    "completion": """\
Print a script that lets a shell complete commands, options and choices.

The shell reads it when it starts: save it as
~/.local/share/bash-completion/completions/lrf3d, or put eval "$(lrf3d completion zsh)" into
~/.zshrc.

SHELL bash|zsh: The shell.

Example: lrf3d completion bash""",
}
