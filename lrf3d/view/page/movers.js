// What moves beside the robot: bodies with an outline and a height, in the world and in the inset.

import { THREE } from "nicegui-scene";

const COLOUR = 0x8a52c4;

export class Movers {
  // bodies: outline x, y, x, y, … in the body's own frame [m], and height [m] of each.
  constructor(scene, bodies) {
    const paint = new THREE.MeshStandardMaterial({ color: COLOUR, roughness: 0.7 });
    this.bodies = bodies.map(({ outline, height }) => {
      const corners = [];
      for (let i = 0; i < outline.length; i += 2) {
        corners.push(new THREE.Vector2(outline[i], outline[i + 1]));
      }
      const form = { depth: height, bevelEnabled: false };
      const mesh = new THREE.Mesh(new THREE.ExtrudeGeometry(new THREE.Shape(corners), form), paint);
      scene.add(mesh);
      return { corners, mesh };
    });
  }

  // poses: x, y, theta of each in turn.
  show(poses) {
    this.bodies.forEach(({ mesh }, i) => {
      mesh.position.set(poses[3 * i], poses[3 * i + 1], 0);
      mesh.rotation.z = poses[3 * i + 2];
    });
  }

  // Their corners as they stand now.
  seen() {
    return this.bodies.map(({ corners, mesh }) => {
      const { x, y } = mesh.position;
      const [cos, sin] = [Math.cos(mesh.rotation.z), Math.sin(mesh.rotation.z)];
      return corners.map((at) => [x + cos * at.x - sin * at.y, y + sin * at.x + cos * at.y]);
    });
  }
}
