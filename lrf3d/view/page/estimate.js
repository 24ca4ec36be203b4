// Where the robot believed itself to be: its trail, the ellipses that stay, and that of now.

import { THREE } from "nicegui-scene";

import { Trail, raise } from "./marks.js";
import { after, blend, between } from "./replay.js";
import { paintOf } from "./stage.js";

export class Estimate {
  constructor(scene, run, look) {
    this.run = run;
    this.look = look;
    this.trail = new Trail(scene, look);
    this.trail.set(run.estimatePlaces);
    this.kept = this.mesh(scene, look.faded);
    this.now = this.mesh(scene, 1);
    this.lift(0, false);
  }

  mesh(scene, opacity) {
    const paint = new THREE.MeshBasicMaterial({
      color: paintOf(this.look.colour),
      side: THREE.DoubleSide,
      transparent: true,
      opacity,
    });
    const mesh = new THREE.Mesh(new THREE.BufferGeometry(), paint);
    mesh.frustumCulled = false;
    scene.add(mesh);
    return mesh;
  }

  // Make it at least so wide [m], and lay it on the ground or over everything.
  lift(width, over) {
    this.trail.lift(width, over);
    this.width = Math.max(this.look.width, width);
    for (const mesh of [this.kept, this.now]) {
      raise(mesh, over, 10);
      mesh.material.transparent = true;
    }
    const { run } = this;
    const rings = Array.from(run.keptEllipses, (i) => this.ring(run.ellipsePlace(i), run.shape(i)));
    this.rings = rings;
    this.fill(this.kept, rings);
  }

  // Show what is there at a time; gives where the robot is believed to be then.
  show(time) {
    const { run } = this;
    const legs = Math.max(0, Math.min(run.estimateTimes.length, after(run.estimateTimes, time)) - 1);
    const place = run.believed(time);
    this.trail.show(legs, { x: place[0], y: place[1] });
    const rings = this.ringsBefore(time);
    this.kept.geometry.setDrawRange(0, 6 * this.look.corners * rings.length);
    this.fill(this.now, [this.ring(place, run.shapeAt(time))]);
    this.seen = { legs, place, rings: [...rings, this.ring(place, run.shapeAt(time))] };
    return place;
  }

  ringsBefore(time) {
    const { keptEllipses, ellipseTimes } = this.run;
    let count = 0;
    while (count < keptEllipses.length && ellipseTimes[keptEllipses[count]] <= time) count++;
    return this.rings.slice(0, count);
  }

  // The corners of an ellipse, x and y of each.
  ring([x, y], [a, b, c, d]) {
    return Array.from({ length: this.look.corners }, (_, i) => {
      const angle = (2 * Math.PI * i) / this.look.corners;
      const [cos, sin] = [Math.cos(angle), Math.sin(angle)];
      return { x: x + a * cos + b * sin, y: y + c * cos + d * sin, u: cos, v: sin };
    });
  }

  // Ribbons along rings.
  fill(mesh, rings) {
    const places = new Float32Array(18 * this.look.corners * rings.length);
    let at = 0;
    for (const ring of rings) {
      const sides = ring.map(({ x, y, u, v }) => {
        const [du, dv] = [(u * this.width) / 2, (v * this.width) / 2];
        return [[x - du, y - dv, this.look.height], [x + du, y + dv, this.look.height]];
      });
      sides.forEach(([inner, outer], i) => {
        const [nextInner, nextOuter] = sides[(i + 1) % sides.length];
        for (const corner of [inner, outer, nextOuter, inner, nextOuter, nextInner]) {
          places.set(corner, at);
          at += 3;
        }
      });
    }
    mesh.geometry.dispose();
    mesh.geometry = new THREE.BufferGeometry();
    mesh.geometry.setAttribute("position", new THREE.BufferAttribute(places, 3));
  }
}
