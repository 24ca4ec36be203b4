// The camera: as the server says, or round the robot or the world as the hand says.

import { THREE, OrbitControls } from "three";

const AIM = 0.6; // Height that a following camera looks at [m].
const CLEARANCE = 0.4; // Distance from walls that it keeps [m].
const LOWER = 0.26; // How far under the middle the robot is then seen, in halves of the picture,
const OVER = 0.12; // or over it, where the picture is upright and pads are below.
const CALM = 3.0; // How fast it follows turns [1/s].
const BY_HAND = ["follow", "orbit"];

export class Rig {
  constructor(world, { indoor, roof }) {
    Object.assign(this, { world, camera: world.camera, indoor, roof, heading: 0 });
    this.controls = new OrbitControls(this.camera, world.canvas);
    this.controls.minDistance = 1.2;
    this.controls.maxPolarAngle = 0.49 * Math.PI;
    this.controls.addEventListener("change", () => (world.stale = true));
    this.free = new THREE.Vector3();
    this.rays = new THREE.Raycaster();
  }

  get byHand() {
    return BY_HAND.includes(this.view);
  }

  // Where the hand has put the eye, for the server; nothing where that knows it.
  get eye() {
    return this.view === "orbit" && this.placed ? this.camera.position.toArray() : undefined;
  }

  choose(view) {
    this.view = view;
    this.placed = false;
    this.told = null;
    this.controls.enabled = this.byHand;
  }

  // A look of the server's: taken as it is, or to start from.
  tell(look) {
    // What was asked for in the view before is no news.
    if (look.view !== this.view) return;
    this.told = look;
    if (this.view === "follow" || (this.view === "orbit" && this.placed)) return;
    this.take(look);
    if (this.view !== "orbit") return;
    this.controls.target.fromArray(look.target);
    this.controls.maxDistance = 4 * this.camera.position.distanceTo(this.controls.target);
    this.placed = true;
  }

  take({ eye, target, up, field, shift, near }) {
    const { camera } = this;
    camera.up.fromArray(up);
    camera.position.fromArray(eye);
    camera.lookAt(...target);
    this.lens(field, shift, near);
  }

  lens(field, shift, near) {
    const { width, height } = this.world.canvas;
    this.camera.fov = field;
    this.camera.near = near;
    // The film's picture is moved up by so many halves of its height.
    this.camera.setViewOffset(width, height, 0, (shift * height) / 2, width, height);
  }

  update(seconds) {
    const robot = this.world.bodies.robot.matrix.elements;
    if (this.view === "follow") this.follow(robot, seconds);
    else if (this.view === "orbit" && this.placed) this.controls.update();
    else if (this.world.stale && this.told) this.take(this.told);
  }

  // Move with the robot and turn with it, a little late, whatever the hand has chosen.
  follow(robot, seconds) {
    const { camera, controls } = this;
    const heading = Math.atan2(robot[1], robot[0]);
    const target = new THREE.Vector3(robot[12], robot[13], AIM);
    const before = camera.position.clone();
    if (!this.placed) {
      const [back, up] = this.indoor ? [3.4, this.roof + 2.2] : [4.4, 2.3];
      this.heading = heading;
      this.free.set(-back * Math.cos(heading), -back * Math.sin(heading), up - AIM).add(target);
      controls.target.copy(target);
      controls.maxDistance = 200;
      camera.up.set(0, 0, 1);
      this.placed = true;
    }
    const { width, height } = this.world.canvas;
    this.lens(50, width > height ? -LOWER : OVER, 0.1);
    const turn = Math.atan2(Math.sin(heading - this.heading), Math.cos(heading - this.heading));
    const share = turn * (1 - Math.exp(-CALM * seconds));
    this.heading += share;
    camera.position.copy(this.free).sub(controls.target);
    camera.position.applyAxisAngle(camera.up, share).add(target);
    controls.target.copy(target);
    controls.update();
    this.free.copy(camera.position);
    if (!this.indoor) this.stepInside(target);
    if (before.distanceTo(camera.position) > 1e-4) this.world.stale = true;
  }

  // Where a wall stands between, the camera comes nearer until it is before it.
  stepInside(target) {
    const way = this.camera.position.clone().sub(target);
    const away = way.length();
    this.rays.set(target, way.clone().divideScalar(away));
    this.rays.far = away;
    const [hit] = this.world.solid ? this.rays.intersectObject(this.world.solid, true) : [];
    if (!hit) return;
    const kept = Math.max(0.15, (hit.distance - CLEARANCE) / away);
    // The nearer it is, the higher, so that it looks over the robot and not into it.
    way.set(way.x * kept, way.y * kept, Math.max(way.z * kept, 1.1 + 0.9 * (1 - kept)));
    this.camera.position.copy(target).add(way);
    this.camera.lookAt(target);
  }
}
