// The inset: the world from above with the map as it grows, the trail, the beams and the robot.

import { css } from "./stage.js";

const MARGIN = 1.08;
const SIDE = 260; // Its side until the page has shown it [px].

export class Inset {
  constructor(canvas, { low, high, houses, walls, look }) {
    this.look = look;
    this.canvas = canvas;
    this.draw = canvas.getContext("2d");
    const largest = Math.max(high[0] - low[0], high[1] - low[1], 4) * MARGIN;
    this.whole = largest <= look.inset.whole;
    this.extent = this.whole ? largest : look.inset.followed;
    this.side = SIDE;
    this.middle = [0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])];
    this.houses = new Path2D();
    for (const house of houses) {
      for (let i = 0; i < house.length; i += 2) {
        if (i === 0) this.houses.moveTo(house[0], house[1]);
        else this.houses.lineTo(house[i], house[i + 1]);
      }
      this.houses.closePath();
    }
    this.walls = new Path2D();
    for (let i = 0; i < walls.length; i += 5) {
      this.walls.moveTo(walls[i], walls[i + 1]);
      this.walls.lineTo(walls[i + 2], walls[i + 3]);
    }
    this.map = [];
    this.fit();
  }

  // Take up the size that it has on the page; returns whether that has changed.
  fit() {
    const ratio = Math.min(window.devicePixelRatio, 2);
    // Where it is not shown it has none.
    const side = this.canvas.clientWidth || this.side;
    if (this.canvas.width === Math.round(side * ratio)) return false;
    Object.assign(this, { side, ratio, scale: side / this.extent });
    this.canvas.width = this.canvas.height = Math.round(side * ratio);
    return true;
  }

  setMap(segments, colours) {
    // One path a colour: there are far fewer objects than segments.
    const paths = new Map();
    for (let i = 0; 4 * i < segments.length; i++) {
      const colour = `rgb(${Array.from(colours.slice(3 * i, 3 * i + 3)).join(",")})`;
      if (!paths.has(colour)) paths.set(colour, new Path2D());
      const path = paths.get(colour);
      path.moveTo(segments[4 * i], segments[4 * i + 1]);
      path.lineTo(segments[4 * i + 2], segments[4 * i + 3]);
    }
    this.map = [...paths];
  }

  show(robot, trail, legs, beams, scanning, obstacles, estimate) {
    const { draw, ratio, side, scale, look } = this;
    const [x, y] = this.whole ? this.middle : [robot.x, robot.y];
    const pixel = 1 / scale;
    draw.setTransform(1, 0, 0, 1, 0, 0);
    draw.fillStyle = css(look.inset.paper);
    draw.fillRect(0, 0, side * ratio, side * ratio);
    const by = ratio * scale;
    draw.setTransform(by, 0, 0, -by, ratio * (side / 2 - scale * x), ratio * (side / 2 + scale * y));
    draw.fillStyle = css(look.inset.stone);
    draw.fill(this.houses, "evenodd");
    draw.strokeStyle = css(look.inset.stone);
    draw.lineWidth = pixel;
    draw.stroke(this.walls);
    if (scanning) this.drawFan(robot, beams);
    if (trail.mesh.visible) this.drawTrail(trail, legs, robot, look.trail.colour, (estimate ? 3.2 : 1.6) * pixel);
    if (estimate) this.drawEstimate(estimate, pixel);
    draw.lineWidth = 2.2 * pixel;
    for (const [colour, path] of this.map) {
      draw.strokeStyle = colour;
      draw.stroke(path);
    }
    for (const [body, colour] of obstacles.seen()) {
      draw.fillStyle = colour;
      draw.beginPath();
      for (const [left, up] of body) draw.lineTo(left, up);
      draw.fill();
    }
    this.drawRobot(robot, pixel);
    this.drawScale();
  }

  drawTrail({ places, jumps }, legs, end, colour, width) {
    const { draw } = this;
    draw.strokeStyle = css(colour);
    draw.lineWidth = width;
    draw.beginPath();
    for (let i = 0; i <= legs && 2 * i < places.length; i++) {
      if (jumps.has(i - 1)) draw.moveTo(places[2 * i], places[2 * i + 1]);
      else draw.lineTo(places[2 * i], places[2 * i + 1]);
    }
    if (!jumps.has(legs)) draw.lineTo(end.x, end.y);
    draw.stroke();
  }

  drawEstimate({ trail, seen, look }, pixel) {
    const [x, y] = seen.place;
    this.drawTrail(trail, seen.legs, { x, y }, look.colour, 1.4 * pixel);
    this.draw.beginPath();
    for (const ring of seen.rings) {
      this.draw.moveTo(ring.at(-1).x, ring.at(-1).y);
      for (const corner of ring) this.draw.lineTo(corner.x, corner.y);
    }
    this.draw.stroke();
  }

  // A bar of a round length with its number, as in the film.
  drawScale() {
    const { draw, ratio, side, scale } = this;
    // The longest of 1, 2 and 5 times a power of ten that takes up to a third of the side.
    const most = side / scale / 3;
    const power = 10 ** Math.floor(Math.log10(most));
    const metres = power * [5, 2, 1].find((step) => step * power <= most);
    const [text, long] = [`${metres} m`, metres * scale];
    draw.setTransform(ratio, 0, 0, ratio, 0, 0);
    draw.font = '12px "DejaVu Sans", "Segoe UI", system-ui, sans-serif';
    draw.fillStyle = css(this.look.inset.paper, 0.8);
    draw.fillRect(0, side - 32, Math.max(long, draw.measureText(text).width) + 16, 32);
    draw.fillStyle = "#3c4654";
    draw.fillText(text, 8, side - 14);
    draw.strokeStyle = "#3c4654";
    draw.lineWidth = 1.5;
    draw.beginPath();
    draw.moveTo(8, side - 10);
    draw.lineTo(8, side - 6);
    draw.lineTo(8 + long, side - 6);
    draw.lineTo(8 + long, side - 10);
    draw.stroke();
  }

  drawFan(robot, { ends, reach }) {
    const { draw } = this;
    const fade = draw.createRadialGradient(robot.x, robot.y, 0, robot.x, robot.y, reach);
    fade.addColorStop(0, css(this.look.fan.colour, 0.5));
    fade.addColorStop(1, css(this.look.fan.colour, 0));
    draw.fillStyle = fade;
    draw.beginPath();
    draw.moveTo(robot.x, robot.y);
    for (let i = 0; i < ends.length; i += 2) draw.lineTo(ends[i], ends[i + 1]);
    draw.closePath();
    draw.fill();
  }

  drawRobot(robot, pixel) {
    const { draw } = this;
    draw.save();
    draw.translate(robot.x, robot.y);
    draw.rotate(robot.theta);
    draw.scale(9 * pixel, 9 * pixel);
    draw.beginPath();
    for (const [x, y] of this.look.robot.dart) draw.lineTo(x, y);
    draw.closePath();
    draw.fillStyle = css(this.look.robot.colour);
    draw.strokeStyle = css(this.look.robot.rim);
    draw.lineWidth = 0.16;
    draw.fill();
    draw.stroke();
    draw.restore();
  }
}
