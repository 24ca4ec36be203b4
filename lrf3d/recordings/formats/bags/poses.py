"""The poses of the scans of a bag: by which robot's odometry and which clock."""

import re
from collections.abc import Sequence
from dataclasses import replace
from os.path import basename, commonpath, dirname

import numpy as np

from lrf3d.base.errors import InputError, one_line
from lrf3d.base.text import counted
from lrf3d.base.units import NANO
from lrf3d.geometry.lines import usual_step
from lrf3d.geometry.pose import Pose
from lrf3d.laser import LaserScan
from lrf3d.recordings.formats.bags.contents import DRIFTING, Contents, ScanStream, edges_of
from lrf3d.recordings.formats.bags.frames import BACK, BagPart, Frames, FrameTrack, in_the_plane
from lrf3d.recordings.log import COARSE, LaserLog

# Parts that a recording may have; where stamps go back more often, they are useless.
MOST_PARTS = 20

# Words in the names of topics whose poses are goals or guesses, not those of a robot.
AIMS = ("goal", "initialpose")

# Least interval of coarse odometry, in intervals of scans.
COARSE_SCANS = 3.0

# Clocks that differ by more than this [ns] are not the same: transforms are published up to a
# second ahead, and scans some tenths late.
CLOCKS_APART = 2 * BACK


# Least cosine of the tilt of a laser; one that is tilted more does not scan in the plane.
LEAST_UPRIGHT = np.cos(np.radians(15.0))


def log_of(contents: Contents, wanted: str, part: int | None) -> LaserLog:
    """The scans of the robot of the first stream, with the poses of the wanted source."""
    notes = contents.intake.notes
    robot = _robot_of(contents, wanted, part)
    there = ", ".join(robot.there) or robot.lacks
    if not robot.source and wanted not in ("auto", "odom"):
        raise InputError(f"{contents.intake.path}: no poses from {wanted} in it; there are {there}")
    used = _streams_of(robot, contents)
    notes.extend(filter(None, (robot.coarse, robot.others)))
    notes.extend(dict.fromkeys(filter(None, (each.note for each in used))))
    notes.extend(
        f"left out: {counted(each.outside, 'reading')} of {each.topic} beyond its limits"
        for each in used
        if each.outside
    )
    if len(used) > 1:
        notes.append("lasers: " + ", ".join(each.words for each in used))
    scans = [scan for each in used for scan in robot.placed(each)]
    if not scans:
        within = f"no scan within the time of the poses from {robot.words}"
        raise InputError(f"{contents.intake.path}: {within}")
    return contents.intake.log(
        sorted(scans, key=lambda scan: scan.time),
        source=robot.words if robot.source else f"none: {there}",
        placed=bool(robot.source),
        fans=used[0].fans if len(used) == 1 else (),
    )


def _robot_of(contents: Contents, wanted: str, part: int | None) -> "_Robot":
    """The robot of the first stream, by the times of receipt where its stamps are useless."""
    first = contents.streams[0]
    robot = _Robot(contents, first, _part(contents, first, part), wanted)
    if not (doubt := robot.doubt()):
        return robot
    contents.intake.notes.append(f"{doubt}: times of receipt count")
    return _Robot(contents, first, replace(robot.part, by_receipt=True), wanted)


def _streams_of(robot: "_Robot", contents: Contents) -> list[ScanStream]:
    """The streams of a robot's lasers, the preferred one first; a note names other streams."""
    used: dict[str, ScanStream] = {}
    for stream in contents.streams:
        # Of several versions of the scans of a frame the first counts.
        if robot.has(stream):
            used.setdefault(stream.frame, stream)
    left = [each.words for each in contents.streams if each is not used.get(each.frame)]
    if left:
        found = one_line(", ".join(left), 200)
        contents.intake.notes.append(f"left out: {found}; see --scan-topic")
    return list(used.values())


def _part(contents: Contents, stream: ScanStream, wanted: int | None) -> BagPart:
    """The part that was chosen, or the longest one, of a recording whose stamps go back."""
    path = contents.intake.path
    notes = contents.intake.notes
    sent, _, numbers = stream.track.stamps
    back = np.flatnonzero(np.diff(sent) < -BACK) + 1
    count = len(back) + 1
    if wanted is not None and not 1 <= wanted <= count:
        raise InputError(f"{path}: no part {wanted}: the stamps of its scans make {count} of them")
    if not len(back):
        return BagPart(back, 0)
    found = (
        f"the stamps of {stream.topic} go back at message {numbers[back[0]]}"
        f" from {NANO * sent[back[0] - 1]:.10g} to {NANO * sent[back[0]]:.10g} s"
    )
    if count > MOST_PARTS:
        notes.append(f"{found}, and {count - 2} times more: times of receipt count")
        return BagPart(back[:0], 0, by_receipt=True)
    sizes = np.diff([0, *back, len(sent)])
    chosen = int(sizes.argmax()) if wanted is None else wanted - 1
    notes.append(
        f"{found}: part {chosen + 1} of {count} was read, {sizes[chosen]} of {len(sent)} scans;"
        " --part reads another"
    )
    return BagPart(numbers[back], chosen)


class _Robot:
    """The robot of a stream of scans: its frames, its tracks, and the source of its poses.

    ``there`` lists the names of the sources that the bag has; ``source`` is the topic of the chosen
    one, or the frame in which transforms give the laser's pose; ``words`` describe it.
    """

    def __init__(self, contents: Contents, stream: ScanStream, part: BagPart, wanted: str) -> None:
        self.part = part
        self._stream = stream
        self._frame = stream.frame
        self._contents = contents
        edges = edges_of(contents, stream.topic)
        self._edges = {child: track for child, (_, track) in edges.items()}
        self._frames = Frames(edges, part)
        self._children = contents.children
        self._tracks = contents.tracks
        sources, further = self._sources()
        self.there = [name for name, found in sources.items() if found]
        name = self.there[0] if wanted == "auto" and self.there else wanted
        self.source = sources.get(name, "")
        drifts = self.source == sources["odom"] or basename(self.source) == DRIFTING
        self._unused = further if drifts else []
        self._base, self.words = self._carrier()

    def _sources(self) -> tuple[dict[str, str], list[str]]:
        """The topic or the frame of each source, "" if there is none, and further poses."""
        topics = [topic for topic in self._own() if len(self._tracks[topic]) > 1]
        truths = [topic for topic in topics if "ground_truth" in topic]
        drives = [topic for topic in topics if topic not in truths]
        driven = [topic for topic in drives if self._children[topic]]
        chain = self._frames.chain(self._frame)
        drifting = [frame for frame in chain if basename(frame) == DRIFTING]
        odom = [*driven, *self._moving(drifting[:1]), *drives, ""][0]
        tree = "".join(self._moving(chain[-1:]))
        further = [topic for topic in drives if topic != odom]
        return {"truth": "".join(truths[:1]), "tf": tree, "odom": odom}, further

    def _moving(self, frames: Sequence[str]) -> list[str]:
        """Those of the given frames above the laser relative to which it moves."""
        chain = self._frames.chain(self._frame)
        moves = np.cumsum([0, *map(self._frames.moves, chain)])
        return [frame for frame in frames if moves[chain.index(frame)]]

    def _own(self) -> list[str]:
        """The topics of poses that may be this robot's, the likeliest first."""

        def rank(name: str) -> tuple[bool, bool, int, bool, str]:
            linked = self._frames.carries(self._children[name], self._frame)
            near = len(commonpath([name, self._stream.topic]))
            return not linked, "filtered" not in name, -near, basename(name) != DRIFTING, name

        own = (
            name
            for name, child in self._children.items()
            if not self._is_foreign(name, child) and not any(word in name for word in AIMS)
        )
        return sorted(own, key=rank)

    def _is_foreign(self, topic: str, child: str) -> bool:
        """Whether the poses of a topic are another robot's."""
        frames = self._frames
        own = dirname(self._frame)
        if dirname(child) and own and dirname(child) != own:
            return True
        both = child in frames and self._frame in frames
        if both and not frames.carries(child, self._frame):
            return True
        # A topic next to the scans of another robot is that robot's.
        there = dirname(topic)
        scanned = there in map(dirname, self._contents.scan_topics)
        return scanned and not self._stream.topic.startswith(there)

    def _carrier(self) -> tuple[str, str]:
        """The frame that the source gives the poses of, and the source in words."""
        frame = self._frame
        base = self._frames.base(frame)
        if frame not in self._frames:
            self._refuse_later_part()
        if self.source not in self._tracks:
            return base, f"/tf, {frame} in {self.source}"
        child = self._children[self.source] or base
        if self._frames.carries(child, frame):
            return child, self.source
        middle = f"the laser in the middle of {child} for want of a transform"
        how = middle if base == frame else f"{base} taken for {child}"
        return base, f"{self.source}, with {how}"

    def _refuse_later_part(self) -> None:
        """Refuse a later part of a recording that lacks the transform of the laser."""
        path = self._contents.intake.path
        driven = self.source in self._tracks and self._children[self.source] != self._frame
        edges = edges_of(self._contents, self._stream.topic)
        above = {basename(parent) for parent, _ in edges.values()}
        moved = driven or (not self.source and above & {DRIFTING, "map"})
        if moved and re.search(r"_[1-9]\d*\.(db3|mcap)$", path.name):
            raise InputError(
                f"{path}: a later part of a recording, without its /tf_static, which says where"
                f" {self._frame} is mounted; read the folder of all parts, or the first one"
            )

    @property
    def lacks(self) -> str:
        """What a bag lacks that gives no poses."""
        of = f" of {self._frame}" if self._edges else ""
        return f"no ground truth, no transforms{of}, no odometry"

    @property
    def others(self) -> str:
        """A note on poses that are not used; "" if all are."""
        if not self._unused:
            return ""
        return f"poses from {self.source}, not from {one_line(', '.join(self._unused), 90)}"

    @property
    def coarse(self) -> str:
        """A note on poses that are much rarer than scans; "" if they are not."""
        track = self._tracks.get(self.source) or self._edges.get(self._base)
        if not self.source or not track:
            return ""
        apart, scans = (usual_step(NANO * each.times(self.part)[0])
                        for each in (track, self._stream.track))  # fmt: skip
        if not scans or apart < max(COARSE, COARSE_SCANS * scans):
            return ""
        return (
            f"poses of {self.words.partition(',')[0]} are {apart:.2g} s apart: interpolated for"
            " scans between them"
        )

    def doubt(self) -> str:
        """What is wrong with the stamps of this robot's scans or poses; "" if nothing is."""
        if self.part.by_receipt:
            return ""
        own = self._stream.track
        tracks = self._used_tracks()
        for name, track in {self._stream.topic: own, **tracks}.items():
            if known := track.stamps_repeat:
                if known == 1:
                    return f"the stamps of {name} are all {NANO * track.stamps[0, 0]:g} s"
                return f"{len(track)} messages of {name} have only {known} different stamps"
        for name, track in tracks.items():
            apart = 0.0 if track.stands else own.ahead() - track.ahead()
            if abs(apart) > CLOCKS_APART:
                way = "ahead of" if apart > 0 else "behind"
                return (
                    f"the stamps of {self._stream.topic} are {NANO * abs(apart):.3g} s {way} {name}"
                )
        return ""

    def _used_tracks(self) -> dict[str, FrameTrack]:
        """The tracks of stamped poses from which those of the laser are computed, by name."""
        chain = self._frames.chain(self._frame)
        tracks = {f"/tf of {frame}": self._edges[frame] for frame in chain if frame in self._edges}
        if self.source in self._tracks:
            tracks[self.source] = self._tracks[self.source]
        return {name: track for name, track in tracks.items() if not track.is_static}

    def has(self, stream: ScanStream) -> bool:
        """Whether a stream is this one, or of another laser of this robot whose poses are known."""
        mine = self._frames.base(self._frame)
        return stream is self._stream or (
            bool(self.source) and self._frames.carries(mine, stream.frame)
        )

    def _has_others(self, stream: ScanStream) -> bool:
        """Whether the robot has another laser than that of a stream."""
        return any(self.has(each) for each in self._contents.streams if each is not stream)

    def placed(self, stream: ScanStream) -> list[LaserScan]:
        """The scans of a stream with their poses and where the laser is mounted."""
        intake = self._contents.intake
        frames = self._frames
        times, inside = stream.track.times(self.part)
        mounted = frames.poses(stream.frame, self._base, times)
        if not self.source:
            laser = np.where(np.isfinite(mounted), np.eye(4), np.nan)
            laser[:, 2, 2] = mounted[:, 2, 2]
        elif self.source in self._tracks:
            motion = self._tracks[self.source].within(self.part)
            laser = mounted * np.nan if motion is None else motion.at(times) @ mounted
        else:
            laser = frames.poses(stream.frame, self.source, times)
        # The cosine of the tilt is 1 for an upright laser and −1 for one upside down.
        mounts = in_the_plane(mounted)
        poses = in_the_plane(laser)
        upright = laser[:, 2, 2]
        known = np.isfinite(laser[:, 0, 0])
        askew = np.abs(upright[known & inside & ~(np.abs(upright) >= LEAST_UPRIGHT)])
        if len(askew):
            tilt = np.degrees(np.arccos(min(askew[0], 1.0)))
            tilted = f"the laser {stream.frame} is tilted by {tilt:.0f}°"
            if not self._has_others(stream):
                raise InputError(f"{intake.path}: {tilted}, expected one that scans in the plane")
            intake.notes.append(f"{tilted}: left out")
            return []
        scans = []
        for number in np.flatnonzero(inside).tolist():
            if not known[number]:
                why = (
                    f"scan {number + 1} lies outside the time that poses are known for, or in a gap"
                )
                intake.refuse(number + 1, why, "scan")
                continue
            scan = stream.scans[number]
            scan = replace(
                scan,
                pose=Pose(*poses[number].tolist()),
                mount=Pose(*mounts[number].tolist()),
                laser=stream.frame,
                angles=scan.angles if upright[number] > 0.0 else -scan.angles,
                time=NANO * times[number] if self.part.by_receipt else scan.time,
            )
            scans.append(scan)
        return scans
