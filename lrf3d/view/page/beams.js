// The beams of a scan: the fan, single beams with their turns at mirrors, hit points coloured by
// range or intensity, the trace on walls.

import { THREE } from "nicegui-scene";

import { paintOf } from "./stage.js";
import { follow } from "./turns.js";

const MOST_TURNS = 8; // Turns of a beam: room for its legs is made where there are mirrors.

const FADING = {
  vertexShader: `
    attribute float range;
    attribute float share;
    varying float away;
    varying float left;
    void main() {
      away = range;
      left = share;
      gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
    }`,
  fragmentShader: `
    uniform float reach, strength, curve;
    uniform vec3 colour;
    varying float away;
    varying float left;
    void main() {
      float near = clamp(1.0 - away / reach, 0.0, 1.0);
      gl_FragColor = vec4(colour, strength * left * pow(near, curve));
    }`,
};

const DOTS = {
  vertexShader: `
    attribute vec3 tint;
    uniform float focus;
    uniform vec3 sizes;
    varying vec3 paint;
    void main() {
      paint = tint;
      vec4 seen = modelViewMatrix * vec4(position, 1.0);
      gl_PointSize = clamp(sizes.x * focus / -seen.z, sizes.y, sizes.z);
      gl_Position = projectionMatrix * seen;
    }`,
  fragmentShader: `
    varying vec3 paint;
    void main() {
      float away = length(gl_PointCoord - 0.5);
      if (away > 0.5) discard;
      gl_FragColor = vec4(paint * (away > 0.36 ? 0.75 : 1.0), 1.0);
    }`,
};

export class BeamsMesh {
  // mirrors: x1, y1, x2, y2 of each in turn.
  constructor(scene, { angles, rangeMax, height, reach }, look, mirrors) {
    this.look = look;
    this.angles = angles;
    this.mirrors = mirrors;
    this.rangeMax = rangeMax;
    this.reach = reach;
    const count = angles.length;
    this.group = new THREE.Group();
    this.group.position.z = height;
    // Where the first leg of each beam ends, and how far that is; all corners of those turned.
    this.ends = new Float32Array(2 * count);
    this.away = new Float32Array(count);
    this.turned = Array(count);

    const corners = 3 * (count - 1);
    this.fan = buffers({ position: [3, corners], range: [1, corners], share: [1, corners] });
    this.fan.attributes.share.array.set(
      Array.from({ length: count - 1 }, (_, i) => {
        const [a, b] = [look.fan.shares[i], look.fan.shares[i + 1]];
        return [(a + b) / 2, a, b];
      }).flat(),
    );
    this.fanMesh = new THREE.Mesh(this.fan, fading(reach, look.fan));

    const step = Math.max(1, Math.round(count / look.beams.drawn));
    this.single = [];
    for (let i = Math.floor(((count - 1) % step) / 2); i < count; i += step) this.single.push(i);
    const room = 2 * this.single.length * (mirrors.length ? 1 + MOST_TURNS : 1);
    this.lines = buffers({ position: [3, room], range: [1, room], share: [1, room] });
    const shares = this.single.flatMap((beam) => [look.fan.shares[beam], look.fan.shares[beam]]);
    // Legs after a mirror are as faint from end to end.
    this.lines.attributes.share.array.fill(look.beams.turned).set(shares);
    const lines = new THREE.LineSegments(this.lines, fading(reach, look.beams));

    this.dots = buffers({ position: [3, count], tint: [3, count] });
    const sizes = new THREE.Vector3(...look.points.sizes);
    const uniforms = { focus: { value: 700 }, sizes: { value: sizes } };
    this.dotPaint = new THREE.ShaderMaterial({ ...DOTS, uniforms });
    const dots = new THREE.Points(this.dots, this.dotPaint);

    this.trace = buffers({ position: [3, 6 * (count - 1)] });
    const paint = new THREE.MeshBasicMaterial({ color: paintOf(look.trace.colour), side: THREE.DoubleSide });
    const trace = new THREE.Mesh(this.trace, paint);

    for (const mesh of [this.fanMesh, lines, dots, trace]) {
      // Bounds change with every scan, and the beams are where one looks.
      mesh.frustumCulled = false;
      this.group.add(mesh);
    }
    this.fanMesh.renderOrder = 2;
    lines.renderOrder = 3;
    scene.add(this.group);
  }

  // The fan is weaker where the robot's eyes look through it.
  set ahead(on) {
    const { strength, ahead } = this.look.fan;
    this.fanMesh.material.uniforms.strength.value = strength * (on ? ahead : 1);
  }

  // Show a scan taken at a pose, from where the robot stands now.
  show(pose, ranges, joined, robot, darkness) {
    const { angles, ends, away } = this;
    const count = angles.length;
    for (let i = 0; i < count; i++) {
      const range = ranges[i];
      const length = Number.isFinite(range) ? range : range < 0 ? 0 : this.rangeMax;
      let end = [
        pose.x + length * Math.cos(pose.theta + angles[i]),
        pose.y + length * Math.sin(pose.theta + angles[i]),
      ];
      if (this.mirrors.length) {
        const { corners, first } = follow(this.mirrors, [pose.x, pose.y], end);
        this.turned[i] = first < 0 ? undefined : { corners, first };
        end = corners[0];
      }
      ends.set(end, 2 * i);
      away[i] = Math.hypot(ends[2 * i] - robot.x, ends[2 * i + 1] - robot.y);
    }
    // What lies on one wall is seen together only by way of one mirror.
    const together = (i) => joined[i] && this.turned[i]?.first === this.turned[i + 1]?.first;
    this.showFan(ranges, together, robot);
    this.showLines(robot);
    this.showDots(ranges, robot, darkness);
    this.showTrace(together, robot);
  }

  showFan(ranges, together, robot) {
    const place = this.fan.attributes.position.array;
    const range = this.fan.attributes.range.array;
    for (let i = 0; i + 1 < this.angles.length; i++) {
      const open = !Number.isFinite(ranges[i]) && !Number.isFinite(ranges[i + 1]);
      // Between two beams that ended on different walls the fan goes as far as the shorter.
      const limit = together(i) || open ? Infinity : Math.min(this.away[i], this.away[i + 1]);
      place.set([robot.x, robot.y, 0], 9 * i);
      range[3 * i] = 0;
      for (const [corner, beam] of [
        [1, i],
        [2, i + 1],
      ]) {
        const length = this.put(place, 9 * i + 3 * corner, beam, robot, limit);
        range[3 * i + corner] = length;
      }
    }
    changed(this.fan);
  }

  showLines(robot) {
    const place = this.lines.attributes.position.array;
    const range = this.lines.attributes.range.array;
    this.single.forEach((beam, i) => {
      place.set([robot.x, robot.y, 0], 6 * i);
      range[2 * i + 1] = this.put(place, 6 * i + 3, beam, robot, this.reach);
    });
    let corner = 2 * this.single.length;
    for (const beam of this.single) {
      const { corners } = this.turned[beam] ?? { corners: [] };
      for (let i = 0; i + 1 < corners.length; i++) {
        place.set([...corners[i], 0, ...corners[i + 1], 0], 3 * corner);
        corner += 2;
      }
    }
    this.lines.setDrawRange(0, corner);
    changed(this.lines);
  }

  showDots(ranges, robot, darkness) {
    const place = this.dots.attributes.position.array;
    const tint = this.dots.attributes.tint.array;
    const { points, trace } = this.look;
    const farthest = Math.min(this.rangeMax, points.farthest);
    let hits = 0;
    ranges.forEach((range, beam) => {
      if (!Number.isFinite(range)) return;
      this.putHit(place, 3 * hits, beam, robot, 2 * trace.gap);
      const share = darkness ? darkness[beam] / 255 : range / farthest;
      tint.set(between(points.colours, share), 3 * hits);
      hits += 1;
    });
    this.dots.setDrawRange(0, hits);
    changed(this.dots);
  }

  showTrace(together, robot) {
    const place = this.trace.attributes.position.array;
    const [a, b] = [new Float32Array(3), new Float32Array(3)];
    const { gap, half } = this.look.trace;
    let corner = 0;
    for (let i = 0; i + 1 < this.angles.length; i++) {
      if (!together(i)) continue;
      this.putHit(a, 0, i, robot, gap);
      this.putHit(b, 0, i + 1, robot, gap);
      for (const [end, up] of [
        [a, -half],
        [b, -half],
        [b, half],
        [a, -half],
        [b, half],
        [a, half],
      ]) {
        place.set([end[0], end[1], up], 3 * corner);
        corner += 1;
      }
    }
    this.trace.setDrawRange(0, corner);
    changed(this.trace);
  }

  // Put where a beam hit its wall, so far before it on its last leg, into an array.
  putHit(array, start, beam, robot, before) {
    const way = this.turned[beam];
    if (!way) {
      this.put(array, start, beam, robot, this.away[beam] - before);
      return;
    }
    const [[fromX, fromY], [x, y]] = way.corners.slice(-2);
    const length = Math.hypot(x - fromX, y - fromY);
    const share = length > before ? before / length : 0;
    array.set([x + share * (fromX - x), y + share * (fromY - y), 0], start);
  }

  // Put the end of the first leg, at most so far from the robot, into an array; gives how far it is.
  put(array, start, beam, robot, limit) {
    const length = Math.max(0, Math.min(this.away[beam], limit));
    const share = this.away[beam] > 0 ? length / this.away[beam] : 0;
    array[start] = robot.x + share * (this.ends[2 * beam] - robot.x);
    array[start + 1] = robot.y + share * (this.ends[2 * beam + 1] - robot.y);
    array[start + 2] = 0;
    return length;
  }
}

function buffers(attributes) {
  const geometry = new THREE.BufferGeometry();
  for (const [name, [size, count]] of Object.entries(attributes)) {
    const attribute = new THREE.BufferAttribute(new Float32Array(size * count), size);
    attribute.setUsage(THREE.DynamicDrawUsage);
    geometry.setAttribute(name, attribute);
  }
  return geometry;
}

function changed(geometry) {
  for (const attribute of Object.values(geometry.attributes)) attribute.needsUpdate = true;
}

function fading(reach, { strength, curve, colour }) {
  return new THREE.ShaderMaterial({
    ...FADING,
    uniforms: {
      reach: { value: reach },
      strength: { value: strength },
      curve: { value: curve },
      colour: { value: new THREE.Vector3(...colour) },
    },
    transparent: true,
    depthWrite: false,
    side: THREE.DoubleSide,
  });
}

// The colour at a share of the way through a row of colours.
function between(colours, share) {
  const at = Math.min(1, Math.max(0, share)) * (colours.length - 1);
  const low = Math.min(colours.length - 2, Math.floor(at));
  return colours[low].map((value, i) => value + (at - low) * (colours[low + 1][i] - value));
}
