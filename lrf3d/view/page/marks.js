// What the drive leaves behind: its trail on the ground, and the map as bands along the walls.

import { THREE } from "nicegui-scene";

import { paintOf } from "./stage.js";

const THROUGH = 0.55; // How strongly the map shines through what hides it.

// Draw a mark over all that stands, or among it again.
export function raise(mesh, over, order) {
  mesh.material.depthTest = !over;
  // What is translucent is drawn last, so that nothing is drawn over it.
  mesh.material.transparent = over;
  mesh.renderOrder = over ? order : 0;
}

export class Trail {
  constructor(scene, look) {
    this.look = look;
    const color = paintOf(look.colour);
    this.paint = new THREE.MeshBasicMaterial({ color, side: THREE.DoubleSide });
    this.mesh = new THREE.Mesh(new THREE.BufferGeometry(), this.paint);
    this.mesh.frustumCulled = false;
    scene.add(this.mesh);
    this.width = look.width;
    this.set([]);
  }

  // Make the trail at least so wide [m], and lay it on the ground or over everything.
  lift(width, over) {
    raise(this.mesh, over, 10);
    this.width = Math.max(this.look.width, width);
    this.fill(0);
    this.cut = 0;
  }

  // The places that the trail leads through: x, y, x, y, … ; legs that are jumps are left out.
  set(places, jumps = new Set()) {
    this.places = Array.from(places);
    this.jumps = jumps;
    this.room = 0;
    this.fill(0);
  }

  add(x, y) {
    this.places.push(x, y);
    this.fill(this.places.length / 2 - 2);
  }

  fill(from) {
    const legs = Math.max(0, this.places.length / 2 - 1);
    if (legs + 1 > this.room) {
      this.room = 2 * legs + 64;
      const array = new Float32Array(18 * this.room);
      const attribute = new THREE.BufferAttribute(array, 3);
      this.mesh.geometry.dispose();
      this.mesh.geometry = new THREE.BufferGeometry();
      this.mesh.geometry.setAttribute("position", attribute);
      from = 0;
    }
    for (let leg = Math.max(0, from); leg < legs; leg++) this.put(leg, this.end(leg + 1));
    this.mesh.geometry.attributes.position.needsUpdate = true;
  }

  end(place) {
    return [this.places[2 * place], this.places[2 * place + 1]];
  }

  put(leg, [x, y]) {
    const [x0, y0] = this.end(leg);
    const long = Math.hypot(x - x0, y - y0);
    const half = this.jumps.has(leg) || long === 0 ? 0 : this.width / 2 / long;
    const [dx, dy] = [-(y - y0) * half, (x - x0) * half];
    const [a, b] = [[x0 - dx, y0 - dy], [x - dx, y - dy]];
    const [c, d] = [[x + dx, y + dy], [x0 + dx, y0 + dy]];
    const corners = [a, b, c, a, c, d].flatMap((place) => [...place, this.look.height]);
    this.mesh.geometry.attributes.position.array.set(corners, 18 * leg);
  }

  // Show the first legs whole, and one more as far as the robot is on it.
  show(legs, robot) {
    const all = Math.max(0, this.places.length / 2 - 1);
    for (let leg = this.cut ?? all; leg < Math.min(legs, all); leg++) {
      this.put(leg, this.end(leg + 1));
    }
    const partly = this.places.length >= 2 && legs < this.room;
    if (partly) this.put(legs, [robot.x, robot.y]);
    this.cut = legs;
    this.mesh.geometry.setDrawRange(0, 6 * (legs + (partly ? 1 : 0)));
    this.mesh.geometry.attributes.position.needsUpdate = true;
  }
}

export class MapBands {
  constructor(scene, look) {
    this.look = look;
    const paint = { vertexColors: true, side: THREE.DoubleSide };
    this.mesh = new THREE.Mesh(new THREE.BufferGeometry(), new THREE.MeshBasicMaterial(paint));
    // What houses hide of it.
    const faint = { transparent: true, opacity: THROUGH, depthFunc: THREE.GreaterDepth, depthWrite: false };
    this.hidden = new THREE.Mesh(this.mesh.geometry, new THREE.MeshBasicMaterial({ ...paint, ...faint }));
    this.mesh.frustumCulled = this.hidden.frustumCulled = false;
    scene.add(this.mesh, this.hidden);
    this.proud = look.width / 2;
    this.shown = [[], [], []];
  }

  // Make the map at least so wide [m], and lay it over everything; or along the walls, and if it
  // has a width, it shines through what hides it.
  lift(width, over) {
    raise(this.mesh, over, 11);
    this.hidden.visible = width > 0 && !over;
    this.proud = Math.max(this.look.width, width) / 2;
    this.show(...this.shown);
  }

  // segments: x1, y1, x2, y2, …; colours: red, green, blue of each in 0…255; tops: how high the
  // band of each reaches [m], which is no higher than its wall.
  show(segments, colours, tops) {
    this.shown = [segments, colours, tops];
    const { proud } = this;
    const count = segments.length / 4;
    const places = new Float32Array(54 * count);
    const paints = new Float32Array(54 * count);
    const colour = new THREE.Color();
    for (let i = 0; i < count; i++) {
      const [x1, y1, x2, y2] = segments.slice(4 * i, 4 * i + 4);
      const long = Math.hypot(x2 - x1, y2 - y1) || 1;
      const [dx, dy] = [(-(y2 - y1) / long) * proud, ((x2 - x1) / long) * proud];
      const high = tops[i];
      const low = high - (this.look.band[1] - this.look.band[0]);
      const [a, b] = [[x1 + dx, y1 + dy], [x2 + dx, y2 + dy]];
      const [c, d] = [[x2 - dx, y2 - dy], [x1 - dx, y1 - dy]];
      const faces = [
        [[...a, low], [...b, low], [...b, high], [...a, high]],
        [[...c, low], [...d, low], [...d, high], [...c, high]],
        [[...a, high], [...b, high], [...c, high], [...d, high]],
      ];
      const corners = faces.flatMap(([p, q, r, s]) => [...p, ...q, ...r, ...p, ...r, ...s]);
      places.set(corners, 54 * i);
      const [red, green, blue] = colours.slice(3 * i, 3 * i + 3);
      colour.setRGB(red / 255, green / 255, blue / 255, THREE.SRGBColorSpace);
      for (let corner = 0; corner < 18; corner++) colour.toArray(paints, 54 * i + 3 * corner);
    }
    this.mesh.geometry.dispose();
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(places, 3));
    geometry.setAttribute("color", new THREE.BufferAttribute(paints, 3));
    this.mesh.geometry = this.hidden.geometry = geometry;
  }
}
