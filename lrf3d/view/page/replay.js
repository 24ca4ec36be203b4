// A recorded run as a function of time: the file holds plain arrays one after the other.

const TYPES = { float32: Float32Array, int32: Int32Array, uint8: Uint8Array };

export class Replay {
  // layout: for each array its type, where it starts [bytes] and how long it is.
  static async load(address, layout, beams) {
    const answer = await fetch(address);
    const bytes = await answer.arrayBuffer();
    const run = new Replay();
    for (const [name, [type, start, length]] of Object.entries(layout)) {
      run[name] = new TYPES[type](bytes, start, length);
    }
    run.beams = beams;
    run.end = run.keyTimes.at(-1);
    run.stageStarts = new Int32Array(run.stageSizes.length + 1);
    run.stageSizes.forEach((size, i) => (run.stageStarts[i + 1] = run.stageStarts[i] + size));
    run.ways = [];
    let first = 0;
    for (const size of run.obstacleSizes) {
      const times = run.obstacleTimes.subarray(first, first + size);
      run.ways.push([times, run.obstaclePoses.subarray(3 * first, 3 * (first + size))]);
      first += size;
    }
    return run;
  }

  // Where all dynamic obstacles are: x, y, theta of each in turn.
  obstacles(time) {
    return this.ways.flatMap(([times, poses]) => {
      const { last, next, share } = between(times, time);
      return [0, 1, 2].map((i) => blend(poses, last, next, share, i));
    });
  }

  // Where the robot is believed to be: x, y.
  believed(time) {
    const { last, next, share } = between(this.estimateTimes, time);
    return [0, 1].map((i) => blend(this.estimatePlaces, last, next, share, i, 2));
  }

  ellipsePlace(number) {
    return this.believed(this.ellipseTimes[number]);
  }

  // The matrix that makes an ellipse of the unit circle.
  shape(number) {
    return this.ellipseShapes.subarray(4 * number, 4 * number + 4);
  }

  shapeAt(time) {
    if (!this.ellipseTimes.length) return [0, 0, 0, 0];
    const { last, next, share } = between(this.ellipseTimes, time);
    return [0, 1, 2, 3].map((i) => blend(this.ellipseShapes, last, next, share, i, 4));
  }

  pose(time) {
    const { keyTimes: times, keyPoses: poses } = this;
    const { last, next, gap, share } = between(times, time);
    const [x, y, theta] = [0, 1, 2].map((i) => blend(poses, last, next, share, i));
    const way = Math.hypot(poses[3 * next] - poses[3 * last], poses[3 * next + 1] - poses[3 * last + 1]);
    const turn = poses[3 * next + 2] - poses[3 * last + 2];
    const moving = gap > 0 && time < this.end;
    return { x, y, theta, speed: moving ? way / gap : 0, turning: moving ? turn / gap : 0 };
  }

  // The scan that is seen at a time; off where the beams rest.
  scan(time) {
    const index = Math.max(0, after(this.begins, time) - 1);
    const i = this.beams;
    return {
      index,
      on: time <= this.ends[index],
      pose: {
        x: this.poses[3 * index],
        y: this.poses[3 * index + 1],
        theta: this.poses[3 * index + 2],
      },
      ranges: this.ranges.subarray(i * index, i * (index + 1)),
      joined: this.joined.subarray((i - 1) * index, (i - 1) * (index + 1)),
      // By intensity, where the run asks for it; else points are coloured by range.
      darkness: this.darkness?.subarray(i * index, i * (index + 1)),
    };
  }

  // The number of the stage of the map at a time, −1 before the first.
  stage(time) {
    return after(this.stageTimes, time) - 1;
  }

  map(stage) {
    const [from, to] = stage < 0 ? [0, 0] : [this.stageStarts[stage], this.stageStarts[stage + 1]];
    return {
      segments: this.segments.subarray(4 * from, 4 * to),
      colours: this.colours.subarray(3 * from, 3 * to),
      tops: this.tops.subarray(from, to),
      objects: stage < 0 ? 0 : this.stageObjects[stage],
    };
  }

  // How many legs of the way have been driven.
  legs(time) {
    return Math.max(0, Math.min(this.keyTimes.length - 1, after(this.keyTimes, time) - 1));
  }

  places() {
    const places = new Float32Array(2 * this.keyTimes.length);
    this.keyTimes.forEach((_, i) => {
      places[2 * i] = this.keyPoses[3 * i];
      places[2 * i + 1] = this.keyPoses[3 * i + 1];
    });
    return places;
  }
}

// The key times on either side of a time, how far apart they are, and the share of that gone by.
export function between(times, time) {
  const next = Math.min(times.length - 1, after(times, time));
  const last = Math.max(0, next - 1);
  const gap = times[next] - times[last];
  const share = gap > 0 ? Math.min(1, Math.max(0, (time - times[last]) / gap)) : 0;
  return { last, next, gap, share };
}

// An entry of rows of so many, between two of them.
export function blend(rows, last, next, share, i, size = 3) {
  return rows[size * last + i] + share * (rows[size * next + i] - rows[size * last + i]);
}

// How many of rising times are not after a time.
export function after(times, time) {
  let [low, high] = [0, times.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle + 1;
    else high = middle;
  }
  return low;
}
