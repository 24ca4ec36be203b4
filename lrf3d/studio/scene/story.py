"""The camera of a story: it opens near the robot, shows what happens, and ends on the whole world.

For each shot, the position is chosen from which the robot is visible and most of the picture is
lit.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from itertools import product
from typing import NamedTuple

import numpy as np
import shapely

from lrf3d.geometry.lines import Float, cross, directions
from lrf3d.studio.scene.bodies import robot_names
from lrf3d.studio.scene.camera import AIM, STEP, CameraPath, Look, SmoothPath
from lrf3d.studio.scene.cameras import chase, corners_of, fitted, overview
from lrf3d.studio.scene.drift import drift_of
from lrf3d.studio.scene.look import NOTHING, SECTION, TINY, Rig
from lrf3d.studio.scene.shots import CLOSING, FIRST_SHOT, LENGTH, SHOTS, plan_shots
from lrf3d.studio.scene.stage.exposure import Exposure
from lrf3d.studio.scene.stage.structures import AROUND, Structures
from lrf3d.studio.scene.staging import STAGINGS
from lrf3d.studio.scene.subject import TITLE_TIME, subject_of
from lrf3d.studio.scene.timeline import Timeline, interpolated

# How far the dark is dusk at first, 0…1: what is not lit can just be seen.
_FIRST_DUSK = 0.4

# Angle by which the camera of an opening turns round the robot [rad].
_NEAR_TURN = 0.35

# When that camera has left its first place, as a share of the opening.
_RISEN = 0.75

# Largest distance of the camera of a shot, as a share of the overview's.
_SHARE = 0.75

# Directions from which a shot of the robot may be taken [rad].
_SIDES = np.radians(np.arange(0.0, 360.0, 30.0))

# Angle by which the camera circles the robot in a shot, to each side of its middle [rad].
_SWAY = np.radians(5.0)

# Angular speed at which the camera circles the world at the end [rad/s of the film].
_END_DRIFT = np.radians(6.0)

# How far its aim moves from the middle of the whole to that of what is pinned, 0…1.
_LEANS = 0.5

# Largest angle by which the camera then turns [rad].
_TURNS_IN_END = 0.6

# How steeply it looks down in the end [rad].
_END_STEEP = np.radians(34.0)

# Number of moments at which a candidate shot is rated.
_JUDGED = 13

# Columns and rows of rays that sample the light in a picture.
_RAYS = (12, 7)

# Distance up to which light is sampled [m]; haze hides what is beyond.
_FARTHEST = 300.0

# Weights of the rating, in which a fully lit picture counts 1. Penalty for a picture of which less
# than half is lit.
_DARK_HALF = 0.8

# Bonus for a picture full of walls that are in the map, which have their colours.
_MAPPED = 2.2

# Share of the robot, over the time of a shot, that walls may hide.
_TOO_MUCH = 0.05

# Penalty for a shot in which the robot is hidden all the time.
_HIDDEN = 12.0

# From which sides [rad] the camera of the proof may look, how steeply down [rad], and which share
# of the sway it has, by how the subject is seen.
_PROOFS = {
    "round": (_SIDES, np.radians([40.0, 52.0, 64.0, 76.0]), 0.4),
    "above": (np.radians([-90.0, 0.0]), np.radians([84.0]), 0.0),
    "aside": (np.radians([-45.0, -135.0]), np.radians([22.0, 28.0, 34.0]), 0.4),
}

# What that camera shows around the robot at the least [m].
_ROOM = 1.5

# The same once a false room is known to be one [m].
_CLOSER = 4.0

# Time in which the camera comes that near [s of the film, as fast as the rest].
_GOES = 0.35

# Angle of view of that camera [rad].
_FIELD = float(np.radians(46.0))


# How many times as fast as the rest a rise is from which on it says so.
_RUSH = 1.2

# How far pictures from eye height are moved up, in halves of their height: lower, they show more
# of the walls.
_LOWERED = -0.25


class _Rigs(NamedTuple):
    """Camera distances [m], downward angles [degrees], and how far pictures are moved up."""

    aways: tuple[float, ...]
    steeps: tuple[float, ...]
    shift: float = 0.0


# Candidate positions of the cameras of shots, in towns and in rooms.
_TOWN = {
    "opening": _Rigs((22.0, 31.0, 44.0), (62.0, 78.0)),
    "chase": _Rigs((4.5, 7.0), (10.0, 16.0), _LOWERED),
    "close": _Rigs((20.0, 28.0), (40.0, 52.0)),
    "above": _Rigs((38.0, 50.0), (74.0,)),
}
_ROOMS = {
    "opening": _Rigs((8.0, 11.0, 14.0), (42.0, 52.0, 62.0)),
    "chase": _Rigs((3.5, 5.5), (32.0, 44.0, 62.0)),
    "close": _Rigs((6.0, 9.0), (40.0, 50.0, 60.0)),
    "above": _Rigs((8.0, 11.0), (68.0, 76.0)),
}

# The same in rooms whose walls are not cut, between which the camera then stands.
_BETWEEN_WALLS = _Rigs((3.4, 5.0), (12.0, 20.0, 30.0), _LOWERED)

# Share of the opening in which walls are not cut, and then sink.
_STANDS = 0.3

# Share of the rise in which walls sink to where they are cut.
_SINKS = 0.2

# Share of the rise in which the map beside the picture leaves.
_LEAVES = 0.6


class _Take(NamedTuple):
    """A camera path, what it is worth, and how much higher than usual walls are cut before it."""

    track: CameraPath
    worth: float = 0.0
    above: float = 0.0


class Story:
    """Shows a run in shots; at times between shots the camera follows the robot."""

    def __init__(
        self,
        timeline: Timeline,
        structures: Structures,
        exposure: Exposure,
        length: float = LENGTH,
    ) -> None:
        self.shots = plan_shots(timeline, length)
        self._subject = subject_of(timeline.run, timeline.playback)
        self._timeline = timeline
        self._structures = structures
        # By how much walls are higher than where those of rooms are cut [m].
        self._above = max(float(structures.heights.max(initial=0.0)) - SECTION, 0.0)
        self._exposure = exposure
        others = (each.path.at for each in timeline.run.obstacles if each.is_robot)
        self._paths = [SmoothPath.of(timeline, poses) for poses in (timeline.poses, *others)]
        # The names of the robots that the shots show by turns; of one, others have none.
        self.names: Sequence[str] = ()
        # Whether it is said where the film is fast forward: not in a single picture or a part.
        self.rushes = True
        # The aspect of the picture when the map beside it has left; 0 if that stays.
        self.widens = 0.0
        # At the end the camera circles the world, past its best side.
        middle = timeline.end + 0.5 * CLOSING * timeline.playback
        self._whole = overview(timeline, structures, middle, _END_DRIFT)
        # What is in the picture of the whole until a drift is removed (n, 3), if it is seen.
        self._ghost = NOTHING[:, :3]
        drift = drift_of(timeline.run)
        if drift is not None and self._subject.since is not None:
            around = shapely.convex_hull(
                shapely.multipoints(drift.alone.poses[:, :2] - timeline.origin)
            )
            ghost = np.insert(shapely.get_coordinates(around), 2, 0.0, axis=1)
            self._ghost = np.vstack([corners_of(timeline, structures), ghost])
        usual = "straight" if structures.indoor else "roofs"
        self._staging = STAGINGS[self._subject.staging or usual]
        self._begins = np.cumsum([0.0, *(shot.length for shot in self.shots)])
        self._chase = chase(timeline, structures)
        self._starts = np.array([shot.start for shot in self.shots])
        self._track = cache(self._made)

    def look(self, time: float, aspect: float) -> Look:
        """The view at a time [s] of the run, also before its start and after its end."""
        number = max(int(np.searchsorted(self._starts, time, side="right")) - 1, 0)
        # The end begins when the run has ended.
        number -= time == self.shots[-1].start
        shot = self.shots[number]
        # Times are rounded, so adjacent shots may leave a gap shorter than a frame.
        if time > shot.end + STEP * self._timeline.playback and shot.name != "end":
            return self._chase.look(time, aspect)
        track, _, above = self._track(number, aspect)
        passed = (time - shot.start) / max(shot.end - shot.start, TINY)
        # The rise shows the whole world, which is then its own map.
        risen = {"rise": passed, "whole": 1.0, "end": 1.0}.get(shot.name, 0.0)
        left = float(_eased(risen / _LEAVES))
        sunk = passed - _STANDS if shot.name == "opening" else risen
        return track.look(
            time,
            cuts=True,
            above=above * float(np.clip(1.0 - sunk / _SINKS, 0.0, 1.0)),
            dusk=max(_FIRST_DUSK, float(_eased(passed))) if shot.name == "opening" else 1.0,
            inset=1.0 - left * bool(self.widens),
            shot=FIRST_SHOT if shot.name == "opening" else shot.name,
            said=self._said(number, time),
            robot=self._robot(number),
        )

    def _said(self, number: int, time: float) -> tuple[str, ...]:
        """The first words on a shot by its number: on its subject, and whether it is fast."""
        shot = self.shots[number]
        subject = self._subject
        share = (time - shot.start) / max(shot.end - shot.start, TINY)
        passed = share * shot.length
        if shot.name == "opening":
            return (subject.title if passed < TITLE_TIME else subject.then,)
        fast = shot.end - shot.start > _RUSH * shot.length * self._timeline.playback
        # The rest of the run is shown in the time that is left.
        told = ("fast forward",) * (self.rushes and fast and shot.name in ("proof", "rise"))
        # That a loop has closed is still said where nothing else happens.
        closed = shot.name == "rise" and subject.since is not None and not fast
        if shot.name == "proof" or closed:
            head = subject.proof if time < subject.until else subject.after
            names = robot_names(self._timeline.run.obstacles, self.names)
            return (head.format(*names), *told)
        return ("", *told)

    def _robot(self, number: int) -> int:
        """Which robot a shot by its number follows: the first one opens and proves."""
        name = self.shots[number].name
        return number % max(1, len(self.names)) if name in SHOTS else 0

    def _made(self, number: int, aspect: float) -> _Take:
        """The camera path of a shot by its number."""
        shot = self.shots[number]
        count = int(np.ceil(shot.length / STEP)) + 1
        times = np.linspace(shot.start, shot.end, count)
        if shot.name == "opening":
            return self._opening(times, aspect)
        # The turn about the whole is even, however fast the run is played.
        turned = self._begins[number] - self._begins[-3] + np.linspace(0.0, shot.length, count)
        turned = self._timeline.end + self._timeline.playback * turned
        wide = self.widens or aspect
        known = self._whole.track(wide).at(turned)._replace(times=times)
        whole = known
        if len(self._ghost):
            whole = fitted(self._ghost, times, whole.turns, whole.steeps[0], whole.fields[0], wide)
        if shot.name == "whole":
            return _Take(whole)
        share = _eased(np.linspace(0.0, 1.0, count))
        if shot.name == "end":
            return _Take(self._between(whole, self._closing(known), share))
        if shot.name == "rise":
            before = self._track(number - 1, aspect)
            held = self._held(before.track, number - 1, times)
            # Walls that were not cut before sink.
            return _Take(self._between(held, whole, share), above=before.above)
        whose = self._paths[self._robot(number)]
        places = interpolated(times, whose.times, whose.places)
        sway = np.linspace(-_SWAY, _SWAY, count)
        if shot.name == "proof":
            return self._proof(times, places, sway, aspect)
        middle = np.interp(0.5 * (times[0] + times[-1]), whose.times, whose.headings)
        path = SmoothPath(times, places, middle + sway)
        return self._best(shot.name, path, np.linspace(times[0], times[-1], _JUDGED), aspect)

    def _opening(self, times: Float, aspect: float) -> _Take:
        """The camera path of the opening: past the robot to what the story is about, and on."""
        timeline = self._timeline
        staging = self._staging
        shares = np.linspace(0.0, 1.0, len(times))
        # The smoothed path of a fast film begins ahead of the robot.
        places = timeline.poses(times)[:, :2] - timeline.origin
        path = SmoothPath(times, places, self._faces() + _NEAR_TURN * (0.5 - shares))
        # Glass hides nothing.
        structures = self._structures
        heights = np.where(structures.glass, 0.0, structures.heights)
        indoor = structures.indoor and not staging.stands
        walls = replace(structures, indoor=indoor, heights=heights)
        # From the side on which walls leave more room.
        sides = [
            CameraPath.along(path, path.headings + side, staging.first).past_walls(walls, places)
            for side in (staging.side, -staging.side)
        ]
        first = max(sides, key=lambda track: float(track.aways.mean()))
        moments = np.linspace(times[0], times[-1], _JUDGED)
        if staging.then is None:
            # What the first scan has lit is best seen when its wave has passed, and from far away.
            then = self._best("opening", path, moments, aspect).track
        else:
            then = CameraPath.along(path, path.headings + staging.then_side, staging.then)
            then = then.past_walls(structures, places)
        track = self._between(first, then, _eased(shares / _RISEN))
        return _Take(track, above=self._above * staging.stands)

    def _faces(self) -> float:
        """Where the opening looks past the robot [rad]: at its subject, or at the farthest hit."""
        scan = self._timeline.run.scans_at(0)[0]
        here = np.array(scan.pose[:2])
        faces = self._subject.faces
        if faces is None:
            places = np.vstack([here, scan.points()])
            faces = places[np.argmax(np.hypot(*(places - here).T))]
        return float(np.arctan2(*(faces - here)[::-1]))

    def _closing(self, whole: CameraPath) -> CameraPath:
        """The camera path near what is pinned in the end; that of the whole if nothing is."""
        places = self._subject.pinned - self._timeline.origin
        if not len(places):
            return whole
        # It turns to the nearer side of the line through these.
        x, y = np.linalg.svd(places - places.mean(axis=0))[2][0]
        turned = np.arctan2(y, x) + self._staging.end_side - whole.turns.mean()
        turned -= np.pi * np.round(turned / np.pi)
        return whole._replace(
            middles=whole.middles + _LEANS * (np.append(places.mean(axis=0), 0.0) - whole.middles),
            turns=whole.turns + np.clip(turned, -_TURNS_IN_END, _TURNS_IN_END),
            steeps=np.full_like(whole.steeps, _END_STEEP),
        )

    def _held(self, track: CameraPath, number: int, times: Float) -> CameraPath:
        """The last view of a shot's track, held relative to its robot at later times (k,)."""
        last = track.at(np.full(len(times), track.times[-1]))
        path = self._paths[self._robot(number)]
        places = interpolated(times, path.times, path.places)
        return last._replace(times=times, middles=np.insert(places, 2, AIM, axis=1))

    def _proof(self, times: Float, places: Float, sway: Float, aspect: float) -> _Take:
        """The camera path of the shot that proves the subject: that and the robot fill it."""
        around = (places[:, None] + _ROOM * AROUND).reshape(-1, 2)
        shown = np.concatenate([around, self._subject.places - self._timeline.origin])
        corners = np.concatenate([np.insert(shown, 2, high, axis=1) for high in (0.0, SECTION)])
        tracks = list[CameraPath]()
        sides, steeps, swayed = _PROOFS[self._subject.seen]
        sway = swayed * sway
        for turn, steep in product(self._subject.along + sides, steeps):
            there = fitted(corners, times[:1], np.array([turn]), steep, _FIELD, aspect)
            track = there.at(times)
            tracks.append(track._replace(turns=track.turns + sway))
        if self._subject.since is not None:
            tracks = [min(tracks, key=lambda track: float(track.aways[0]))]
        path = SmoothPath(times, places, sway)
        best = self._seen(tracks, path, np.linspace(times[0], times[-1], _JUDGED), aspect)
        if self._subject.aim is None:
            return best
        # What the map no longer holds needs no room.
        corners = np.insert((places[:, None] + _CLOSER * AROUND).reshape(-1, 2), 2, 0.0, axis=1)
        turn, steep = best.track.turns[:1], best.track.steeps[0]
        near = fitted(corners, times[:1], turn, steep, _FIELD, aspect).at(times)
        gone = _eased((times - self._subject.until) / (_GOES * self._timeline.playback))
        return best._replace(track=self._between(best.track, near, gone))

    def _best(self, shot: str, path: SmoothPath, moments: Float, aspect: float) -> _Take:
        """The best camera path of a shot from the sides of the robot's path.

        The candidates look at a path from each side, and turn as its headings do.
        """
        indoor = self._structures.indoor
        most = _SHARE * float(self._whole.track(aspect).aways.min())

        def seen(rigs: _Rigs, above: float = 0.0) -> _Take:
            tracks = [
                CameraPath.along(
                    path,
                    path.headings + turn,
                    Rig(min(away, most), steep, shift=rigs.shift),
                )
                for turn, away, steep in product(_SIDES, rigs.aways, rigs.steeps)
            ]
            return self._seen(tracks, path, moments, aspect, above)

        takes = [seen((_ROOMS if indoor else _TOWN)[shot])]
        if indoor and shot == "chase":
            takes.append(seen(_BETWEEN_WALLS, self._above))
        return max(takes, key=lambda take: take.worth)

    def _seen(
        self,
        tracks: list[CameraPath],
        path: SmoothPath,
        moments: Float,
        aspect: float,
        above: float = 0.0,
    ) -> _Take:
        """The best of camera paths: the robot on a path is visible, and most of the picture is lit.

        Walls are cut higher than usual by some metres.
        """
        tops = self._structures.heights if above else self._structures.tops
        eyes = np.array([track.at(moments).eyes() for track in tracks])
        robots = interpolated(moments, path.times, path.places)
        hidden = self._structures.hides(eyes, robots, self._timeline.run.radius, tops)
        # Those that show the robot the most.
        chosen = np.flatnonzero(hidden <= hidden.min() + _TOO_MUCH)
        lit = np.array([self._lit(tracks[k], moments[::4], aspect, tops) for k in chosen.tolist()])
        worth = lit - _DARK_HALF * (lit < 0.5) - _HIDDEN * hidden[chosen]
        best = int(np.argmax(worth))
        return _Take(tracks[int(chosen[best])], float(worth[best]), above)

    def _lit(self, track: CameraPath, moments: Float, aspect: float, tops: Float) -> float:
        """Mean share of the picture that is lit at moments (m,), with a bonus for mapped walls."""
        views = [track.look(time) for time in moments.tolist()]
        ways = np.array([_rays(view, aspect) for view in views])
        count = ways.shape[1]
        ways = ways.reshape(-1, 3)
        eyes = np.repeat([view.eye for view in views], count, axis=0)
        down = ways[:, 2] < -TINY
        share = np.where(down, -eyes[:, 2] / np.where(down, ways[:, 2], -1.0), 0.0)
        ends = eyes + np.minimum(share, _FARTHEST)[:, None] * ways
        number, wall, part = self._structures.blocked(eyes, ends, tops)
        places = ends.copy()
        # Sample in front of a wall, on its visible side, not inside the house.
        ahead = ends[number] - eyes[number]
        before = self._structures.setting.before * self._exposure.cell
        part -= before / np.maximum(np.linalg.norm(ahead, axis=1), TINY)
        places[number] = eyes[number] + part[:, None] * ahead
        # What comes out of a house came in through its roof, which is dark in towns.
        turned = cross(directions(self._structures.segments[wall]), ahead[:, :2]) < 0.0
        roofs = number[turned & self._structures.closed[wall] & (not self._structures.indoor)]
        found = self._exposure.sampled(places[:, :2])
        now, _ = self._exposure.clock(moments, 1.0)
        seen = (found["sure"] > 0.5) & (found["seen"] <= np.repeat(now, count))
        seen[roofs] = False
        mapped = np.zeros(len(seen), bool)
        mapped[number] = found["mapped"][number] <= np.repeat(now, count)[number]
        return float((down & seen).mean() + _MAPPED * (seen & mapped).mean())

    def _between(self, near: CameraPath, far: CameraPath, share: Float) -> CameraPath:
        """Views on the way from a near to a far camera path, at shares (k,) 0…1 of it."""
        # The distance grows exponentially.
        aways = np.exp(np.log(near.aways) + share * np.log(far.aways / near.aways))
        gap = far.aways - near.aways
        moved = (aways - near.aways) / np.where(gap == 0.0, 1.0, gap)
        # Turn the short way round, chosen once, half-way, so that the camera does not jump.
        turned = far.turns - near.turns
        turned -= 2.0 * np.pi * np.round(turned[np.argmin(np.abs(share - 0.5))] / (2.0 * np.pi))
        down = np.sqrt(share)
        fields = near.fields + share * (far.fields - near.fields)
        # Tilt and shift change early, or the robot would leave the picture as the camera rises.
        steeps, shifts = (
            a + down * (b - a) for a, b in ((near.steeps, far.steeps), (near.shifts, far.shifts))
        )
        middles = near.middles + moved[:, None] * (far.middles - near.middles)
        return CameraPath(
            near.times, middles, near.turns + share * turned, steeps, aways, fields, shifts
        )


def _rays(view: Look, aspect: float) -> Float:
    """Directions (n, 3) of rays spread evenly over the picture of a view."""
    columns, rows = ((np.arange(count) + 0.5) / count * 2.0 - 1.0 for count in _RAYS)
    x, y = np.meshgrid(columns, rows)
    tall = np.tan(0.5 * view.field)
    local = np.stack([x * tall * aspect, -(y + view.shift) * tall, -np.ones_like(x)], axis=2)
    return np.asarray(local.reshape(-1, 3) @ view.pose[:3, :3].T)


def _eased(shares: Float | float) -> Float:
    """Shares 0…1, eased: with no speed and no acceleration at both ends."""
    shares = np.clip(shares, 0.0, 1.0)
    return np.asarray(shares**3 * (10.0 - 15.0 * shares + 6.0 * shares**2))
