// The camera: follows the robot, circles a place, looks down, or looks out of the robot's eyes.
// In all of them but the last the mouse or a finger turns and zooms.

import { THREE, OrbitControls } from "nicegui-scene";

export const VIEWS = ["follow", "orbit", "top", "first"];

const AIM = 0.6; // Height that a following camera looks at [m].
const LOW = 1.2; // Walls up to this height [m] do not hide the robot.
const CLEARANCE = 0.4; // Distance from walls that a following camera keeps [m].
const LOWER = 0.13; // How far under the middle a followed robot is seen, in heights of the picture.
const BESIDE = 0.09; // How far right of the middle a world is seen from above, in widths,
const OVER = 0.03; // and how far over it, in heights of the picture.
const UP = 0.09; // How much the robot's eyes look up: that is where houses are;
const EYES = 0.36; // how far they are over the laser [m], above the bands of the map.
const CALM = 3.0; // How fast the camera follows turns [1/s].

const FIELDS = { follow: 50, orbit: 50, top: 12, first: 62 }; // Angles of view [°].

export class Rig {
  constructor(stage, { indoor, walls, low, high, middle, size, height, roof }) {
    Object.assign(this, { stage, indoor, walls, low, high, middle, size, height, roof });
    this.camera = stage.camera;
    this.controls = new OrbitControls(this.camera, stage.canvas);
    this.controls.enableDamping = true;
    this.controls.dampingFactor = 0.12;
    this.target = new THREE.Vector3();
    this.free = new THREE.Vector3();
    this.heading = 0;
  }

  // Take up a view; the robot's pose says where it starts.
  choose(view, pose) {
    this.view = view;
    this.heading = pose.theta;
    this.controls.enabled = view !== "first";
    this.controls.enableRotate = view !== "top";
    this.controls.maxPolarAngle = Math.PI * (view === "top" ? 1 : 0.49);
    this.controls.mouseButtons.LEFT = view === "top" ? THREE.MOUSE.PAN : THREE.MOUSE.ROTATE;
    this.controls.minDistance = view === "follow" ? 1.2 : 3;
    const [x, y] = this.middle;
    if (view === "follow") {
      this.target.set(pose.x, pose.y, AIM);
      const back = this.indoor ? 3.4 : 4.4;
      const up = this.indoor ? this.roof + 2.2 : 2.3;
      this.free.set(-back * Math.cos(pose.theta), -back * Math.sin(pose.theta), up - AIM);
      this.free.add(this.target);
    } else if (view === "orbit") {
      this.target.set(x, y, 0);
      // Into rooms one looks more steeply, so that the near wall hides less.
      const [left, back, up] = this.indoor ? [0.4, 0.55, 0.8] : [0.55, 0.75, 0.6];
      this.free.set(x - left * this.size, y - back * this.size, up * this.size);
    } else if (view === "top") {
      this.target.set(x, y, 0);
      const [wide, tall] = [this.high[0] - this.low[0], this.high[1] - this.low[1]];
      const seen = 1.25 * Math.max(4, tall, wide / this.camera.aspect);
      const away = seen / 2 / Math.tan((FIELDS.top * Math.PI) / 360);
      // A hair off the vertical: straight down there would be no up in the picture.
      this.free.set(x, y - 0.001 * away, away + this.roof);
    }
    const away = this.free.distanceTo(this.target);
    this.controls.maxDistance = Math.max(6 * this.size, 3 * away);
    this.camera.fov = FIELDS[view];
    this.camera.near = view === "top" ? 0.1 * away : 0.1;
    this.camera.far = Math.max(4000, 4 * away);
    this.shift();
    this.camera.position.copy(this.free);
    this.controls.target.copy(this.target);
  }

  // Move the middle of the picture up, so that more of the way ahead is seen; once for each size.
  shift() {
    const { width, height } = this.stage.canvas;
    // From above, the world stands beside the words and over the bar, where there is room.
    const aside = width > height ? BESIDE : 0;
    const shifts = { follow: [0, -LOWER], top: [aside, OVER] };
    const [right, lower] = shifts[this.view] ?? [0, 0];
    this.camera.setViewOffset(width, height, -right * width, lower * height, width, height);
    this.fitted = [width, height];
  }

  // Advance by a time [s]; returns whether the camera has moved.
  update(pose, seconds) {
    const { width, height } = this.stage.canvas;
    if (width !== this.fitted[0] || height !== this.fitted[1]) this.shift();
    this.move(pose, seconds);
    this.camera.updateMatrixWorld();
    const { projectionMatrix: lens, matrixWorld: place } = this.camera;
    const seen = [width, height, ...lens.elements, ...place.elements];
    const turned = seen.some((value, i) => value !== this.seen?.[i]);
    this.seen = seen;
    return turned;
  }

  move(pose, seconds) {
    if (this.view === "first") {
      const [cos, sin] = [Math.cos(pose.theta), Math.sin(pose.theta)];
      this.camera.position.set(pose.x, pose.y, this.height + EYES);
      this.camera.lookAt(pose.x + cos, pose.y + sin, this.height + EYES + UP);
      return;
    }
    this.camera.position.copy(this.free);
    if (this.view === "follow") this.carry(pose, seconds);
    this.controls.update();
    this.free.copy(this.camera.position);
    if (this.view === "follow") this.stepInside();
  }

  // Move with the robot and turn with it, a little late, whatever the hand has chosen.
  carry(pose, seconds) {
    const turn = Math.atan2(Math.sin(pose.theta - this.heading), Math.cos(pose.theta - this.heading));
    const share = turn * (1 - Math.exp(-CALM * seconds));
    this.heading += share;
    const way = this.camera.position.sub(this.controls.target);
    way.applyAxisAngle(new THREE.Vector3(0, 0, 1), share);
    this.controls.target.set(pose.x, pose.y, AIM);
    this.camera.position.add(this.controls.target);
  }

  // Where a wall stands between, the camera comes nearer until it is before it.
  stepInside() {
    const target = this.controls.target;
    const way = this.camera.position.clone().sub(target);
    let share = 1;
    for (let i = 0; i < this.walls.length; i += 5) {
      const cut = crossing(target, way, this.walls, i);
      const over = target.z + cut * way.z > this.walls[i + 4];
      if (cut < share && this.walls[i + 4] > LOW && !over) share = cut;
    }
    if (share === 1) return;
    const flat = Math.hypot(way.x, way.y);
    const kept = Math.max(0.15, share - CLEARANCE / flat);
    // The nearer it is, the higher, so that it looks over the robot and not into it.
    way.x *= kept;
    way.y *= kept;
    way.z = Math.max(way.z * kept, 1.1 + 0.9 * (1 - kept));
    this.camera.position.copy(target).add(way);
    this.camera.lookAt(target);
  }
}

// Which part of a way from a place crosses a wall (x1, y1, x2, y2, height), seen from above.
function crossing(place, way, walls, i) {
  const [ox, oy] = [walls[i] - place.x, walls[i + 1] - place.y];
  const [ax, ay] = [walls[i + 2] - walls[i], walls[i + 3] - walls[i + 1]];
  const across = way.x * ay - way.y * ax;
  if (across === 0) return Infinity;
  const share = (ox * ay - oy * ax) / across;
  const along = (ox * way.y - oy * way.x) / across;
  return share > 0 && along >= 0 && along <= 1 ? share : Infinity;
}
