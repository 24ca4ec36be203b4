// The beams of a scan: the fan, single beams, hit points coloured by range, the trace on walls.

import { THREE } from "nicegui-scene";

const SINGLE_BEAMS = 46;
const FARTHEST_COLOUR = 30; // Range [m] from which hit points have their last colour.
const RAMP = [
  [1.0, 0.93, 0.5],
  [1.0, 0.7, 0.2],
  [1.0, 0.42, 0.14],
  [0.9, 0.2, 0.3],
  [0.68, 0.2, 0.62],
];
const CLEAR = 0.02; // How far before the wall points and trace stand [m].
const TRACE = 0.03; // Half the height of the trace [m].

const FADING = {
  vertexShader: `
    attribute float range;
    varying float away;
    void main() {
      away = range;
      gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0);
    }`,
  fragmentShader: `
    uniform float reach, strength, curve;
    uniform vec3 colour;
    varying float away;
    void main() {
      float left = clamp(1.0 - away / reach, 0.0, 1.0);
      gl_FragColor = vec4(colour, strength * pow(left, curve));
    }`,
};

const DOTS = {
  vertexShader: `
    attribute vec3 tint;
    uniform float focus;
    varying vec3 paint;
    void main() {
      paint = tint;
      vec4 seen = modelViewMatrix * vec4(position, 1.0);
      gl_PointSize = clamp(0.07 * focus / -seen.z, 2.5, 12.0);
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
  constructor(scene, { angles, rangeMax, height, reach }) {
    this.angles = angles;
    this.rangeMax = rangeMax;
    this.reach = reach;
    const count = angles.length;
    this.group = new THREE.Group();
    this.group.position.z = height;
    this.ends = new Float32Array(2 * count);
    this.away = new Float32Array(count);

    this.fan = buffers({ position: [3, 3 * (count - 1)], range: [1, 3 * (count - 1)] });
    this.fanMesh = new THREE.Mesh(this.fan, fading(reach, 0.42, 1.5, [0.98, 0.25, 0.18]));

    const step = Math.max(1, Math.round(count / SINGLE_BEAMS));
    this.single = [];
    for (let i = Math.floor(((count - 1) % step) / 2); i < count; i += step) this.single.push(i);
    this.lines = buffers({
      position: [3, 2 * this.single.length],
      range: [1, 2 * this.single.length],
    });
    const lines = new THREE.LineSegments(this.lines, fading(reach, 0.62, 1.0, [1.0, 0.3, 0.22]));

    this.dots = buffers({ position: [3, count], tint: [3, count] });
    this.dotPaint = new THREE.ShaderMaterial({ ...DOTS, uniforms: { focus: { value: 700 } } });
    const dots = new THREE.Points(this.dots, this.dotPaint);

    this.trace = buffers({ position: [3, 6 * (count - 1)] });
    const paint = new THREE.MeshBasicMaterial({ color: 0xff451f, side: THREE.DoubleSide });
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

  // How strong the fan is: less where it would cover the picture.
  set strength(value) {
    this.fanMesh.material.uniforms.strength.value = value;
  }

  // Show a scan taken at a pose, from where the robot stands now.
  show(pose, ranges, joined, robot) {
    const { angles, ends, away } = this;
    const count = angles.length;
    for (let i = 0; i < count; i++) {
      const range = ranges[i];
      const length = Number.isFinite(range) ? range : range < 0 ? 0 : this.rangeMax;
      ends[2 * i] = pose.x + length * Math.cos(pose.theta + angles[i]);
      ends[2 * i + 1] = pose.y + length * Math.sin(pose.theta + angles[i]);
      away[i] = Math.hypot(ends[2 * i] - robot.x, ends[2 * i + 1] - robot.y);
    }
    this.showFan(ranges, joined, robot);
    this.showLines(robot);
    this.showDots(ranges, robot);
    this.showTrace(joined, robot);
  }

  showFan(ranges, joined, robot) {
    const place = this.fan.attributes.position.array;
    const range = this.fan.attributes.range.array;
    for (let i = 0; i + 1 < this.angles.length; i++) {
      const open = !Number.isFinite(ranges[i]) && !Number.isFinite(ranges[i + 1]);
      // Between two beams that ended on different walls the fan goes as far as the shorter.
      const limit = joined[i] || open ? Infinity : Math.min(this.away[i], this.away[i + 1]);
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
    changed(this.lines);
  }

  showDots(ranges, robot) {
    const place = this.dots.attributes.position.array;
    const tint = this.dots.attributes.tint.array;
    const farthest = Math.min(this.rangeMax, FARTHEST_COLOUR);
    let hits = 0;
    ranges.forEach((range, beam) => {
      if (!Number.isFinite(range)) return;
      this.put(place, 3 * hits, beam, robot, this.away[beam] - 2 * CLEAR);
      tint.set(ramp(range / farthest), 3 * hits);
      hits += 1;
    });
    this.dots.setDrawRange(0, hits);
    changed(this.dots);
  }

  showTrace(joined, robot) {
    const place = this.trace.attributes.position.array;
    const [a, b] = [new Float32Array(3), new Float32Array(3)];
    let corner = 0;
    for (let i = 0; i + 1 < this.angles.length; i++) {
      if (!joined[i]) continue;
      this.put(a, 0, i, robot, this.away[i] - CLEAR);
      this.put(b, 0, i + 1, robot, this.away[i + 1] - CLEAR);
      for (const [end, up] of [
        [a, -TRACE],
        [b, -TRACE],
        [b, TRACE],
        [a, -TRACE],
        [b, TRACE],
        [a, TRACE],
      ]) {
        place.set([end[0], end[1], up], 3 * corner);
        corner += 1;
      }
    }
    this.trace.setDrawRange(0, corner);
    changed(this.trace);
  }

  // Put the end of a beam, at most so far from the robot, into an array; gives how far it is.
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

function fading(reach, strength, curve, colour) {
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

function ramp(share) {
  const at = Math.min(1, Math.max(0, share)) * (RAMP.length - 1);
  const low = Math.min(RAMP.length - 2, Math.floor(at));
  return RAMP[low].map((value, i) => value + (at - low) * (RAMP[low + 1][i] - value));
}
