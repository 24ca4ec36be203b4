// What moves beside the robot: bodies from the file of the scene, and their outlines in the inset.

import { THREE } from "nicegui-scene";

export class Obstacles {
  // bodies: outline x, y, x, y, … in the body's own frame [m], and colour of each in 0…255.
  constructor(scene, root, bodies) {
    this.bodies = bodies.map(({ outline, colour }, i) => {
      const place = new THREE.Group();
      place.add(root.getObjectByName(`obstacle_${i}`));
      scene.add(place);
      const corners = [];
      for (let k = 0; k < outline.length; k += 2) corners.push([outline[k], outline[k + 1]]);
      return { corners, place, colour: `rgb(${colour.join(",")})` };
    });
  }

  // poses: x, y, theta of each in turn.
  show(poses) {
    this.bodies.forEach(({ place }, i) => {
      place.position.set(poses[3 * i], poses[3 * i + 1], 0);
      place.rotation.z = poses[3 * i + 2];
    });
  }

  // Their corners as they stand now, and their colours.
  seen() {
    return this.bodies.map(({ corners, place, colour }) => {
      const { x, y } = place.position;
      const [cos, sin] = [Math.cos(place.rotation.z), Math.sin(place.rotation.z)];
      return [corners.map(([u, v]) => [x + cos * u - sin * v, y + sin * u + cos * v]), colour];
    });
  }
}
