// The sheet: the drawing as the source has it, and what was understood of it, in metres.

export const COLOURS = {
  wall: "#1c2534", furniture: "#94713f", glass: "#2f9fd8", mirror: "#8f5fd0", door: "#37a350", nothing: "#c7a8a0",
};
const WIDTHS = { wall: 2.2, furniture: 1.4, glass: 2.6, mirror: 2.6, door: 1.4, nothing: 0.8 };
const ORANGE = "#f07c14";
export const RED = "#e03131"; // Of what is not reached.
const MANY = 3000; // Strokes above which a moving view shows the last picture, moved.
const CALM = 140; // Time until it is drawn again [ms].
const PEN = { willReadFrequently: true }; // Drawn by the processor: graphics cards are slow at long lists of strokes.
const MOST_PLACED = 60; // Rooms whose names avoid what is drawn: it takes time.
const INK = 30; // Difference of grey from the paper, from 0 to 255, from which something is drawn there.
const WINDOW = 3.6; // Side of the square in which furniture is sought [m].
const CELL = 0.02; // Side of its cells [m].
const ALIKE = 14; // Difference of grey, from 0 to 255, up to which cells belong to one thing.
const LEAST = 0.2; // Least side of furniture [m].
const BESIDE = 0.12; // Distance within which a wall stands at a side [m].
const ROOM_SIDES = 3; // Sides with walls from which on it is a room.
export const LOW = 1.25; // Height below which a wall that was drawn is one of furniture [m].
const CHUNK = 1000; // Strokes of a path: software draws long paths slowly.
const NEAR = 25; // Pixels a metre from which many strokes are as wide as few; fine ones are drawn much faster.

// The point of a line that is nearest to another one.
export function foot([x, y], [x1, y1], [x2, y2]) {
  const [dx, dy] = [x2 - x1, y2 - y1];
  const share = Math.min(1, Math.max(0, ((x - x1) * dx + (y - y1) * dy) / (dx * dx + dy * dy || 1)));
  return [x1 + share * dx, y1 + share * dy];
}

export class Sheet {
  constructor(base, top) {
    this.base = base;
    this.top = top;
    this.view = { x: 0, y: 0, scale: 50 }; // What is in the middle [m], and pixels a metre.
    this.plan = null;
    this.picture = null;
    this.rooms = null;
    this.route = null;
    this.beams = null;
    this.robot = null; // The pose that the beams are cast from.
    this.doubts = []; // Why goals are not reached, by their numbers.
    this.held = null; // Decisions that are shown until the drawing has their scale.
    this.still = 0;
    new ResizeObserver(() => this.resize()).observe(base.parentElement);
  }

  resize() {
    const { clientWidth, clientHeight } = this.base.parentElement;
    const ratio = window.devicePixelRatio || 1;
    for (const canvas of [this.base, this.top]) Object.assign(canvas, { width: clientWidth * ratio, height: clientHeight * ratio });
    Object.assign(this, { width: clientWidth, height: clientHeight, ratio });
    this.stale(true);
  }

  // Take a plan: paths by class, about its origin.
  take(header, arrays) {
    const [ox, oy] = header.origin;
    const { strokes, kinds } = arrays;
    const paths = header.classes.map(() => []);
    const counts = header.classes.map(() => 0);
    for (let row = 0; row < kinds.length; row += 1) {
      const own = paths[kinds[row]];
      if (counts[kinds[row]]++ % CHUNK === 0) own.push(new Path2D());
      const path = own.at(-1);
      path.moveTo(strokes[4 * row], strokes[4 * row + 1]);
      path.lineTo(strokes[4 * row + 2], strokes[4 * row + 3]);
    }
    this.plan = { ...header, ...arrays, ox, oy, paths };
    this.stale(true);
  }

  fit() {
    const [x1, y1, x2, y2] = this.plan.bounds;
    const room = Math.min(this.width / (x2 - x1 || 1), (this.height - 40) / (y2 - y1 || 1));
    this.view = { x: (x1 + x2) / 2, y: (y1 + y2) / 2, scale: 0.86 * room };
    this.stale(true);
  }

  // The corners of the box around what is drawn in a rectangle [m], without what leads out of it, such as walls; nothing, where that is small.
  inkIn(area) {
    const { plan, picture } = this;
    if (!plan.sheet || !picture) return null;
    const step = (plan.sheet[0] * plan.unit) / picture.width; // Metres a pixel.
    const top = plan.sheet[1] * plan.unit;
    const xs = area.map(([x]) => Math.round(x / step));
    const ys = area.map(([, y]) => Math.round((top - y) / step));
    const [left, high] = [Math.min(...xs), Math.min(...ys)];
    const [wide, tall] = [Math.max(...xs) - left, Math.max(...ys) - high];
    if (Math.min(wide, tall) < 4) return null;
    const canvas = document.createElement("canvas");
    Object.assign(canvas, { width: wide, height: tall });
    const context = canvas.getContext("2d", PEN);
    context.drawImage(picture, left, high, wide, tall, 0, 0, wide, tall);
    const { data } = context.getImageData(0, 0, wide, tall);
    const grey = new Uint8Array(wide * tall).map((_, cell) => (data[4 * cell] + data[4 * cell + 1] + data[4 * cell + 2]) / 3);
    const paper = [...grey].sort((a, b) => a - b)[Math.floor(0.8 * grey.length)];
    const ink = grey.map((each) => Math.abs(each - paper) > INK);
    // What is joined to the rim of the rectangle leads out of it.
    const stack = [];
    const drop = (x, y) => {
      if (x < 0 || y < 0 || x >= wide || y >= tall || !ink[y * wide + x]) return;
      ink[y * wide + x] = 0;
      stack.push([x, y]);
    };
    for (let x = 0; x < wide; x += 1) [0, tall - 1].forEach((y) => drop(x, y));
    for (let y = 0; y < tall; y += 1) [0, wide - 1].forEach((x) => drop(x, y));
    while (stack.length) {
      const [x, y] = stack.pop();
      for (const [dx, dy] of [[-1, -1], [0, -1], [1, -1], [-1, 0], [1, 0], [-1, 1], [0, 1], [1, 1]]) drop(x + dx, y + dy);
    }
    let [x1, y1, x2, y2] = [wide, tall, 0, 0];
    ink.forEach((on, cell) => {
      if (!on) return;
      const [x, y] = [cell % wide, Math.floor(cell / wide)];
      [x1, y1, x2, y2] = [Math.min(x1, x), Math.min(y1, y), Math.max(x2, x + 1), Math.max(y2, y + 1)];
    });
    if (x2 - x1 < wide / 2 || y2 - y1 < tall / 2) return null;
    const corner = (x, y) => [(left + x) * step, top - (high + y) * step];
    return [corner(x1, y2), corner(x2, y2), corner(x2, y1), corner(x1, y1)];
  }

  // The corners of the box around what is drawn at a point [m] in one grey, up to its outline; nothing, where that is large, tiny, or a room.
  furnitureAt([x, y]) {
    const { plan, picture } = this;
    if (!plan.sheet || !picture) return null;
    const side = Math.round(WINDOW / CELL);
    const perMetre = picture.width / (plan.sheet[0] * plan.unit);
    const corner = [x - WINDOW / 2, y + WINDOW / 2];
    const canvas = document.createElement("canvas");
    Object.assign(canvas, { width: side, height: side });
    const context = canvas.getContext("2d", PEN);
    context.fillStyle = "#fff";
    context.fillRect(0, 0, side, side);
    context.drawImage(picture, corner[0] * perMetre, (plan.sheet[1] * plan.unit - corner[1]) * perMetre, WINDOW * perMetre, WINDOW * perMetre, 0, 0, side, side);
    const { data } = context.getImageData(0, 0, side, side);
    const grey = new Uint8Array(side * side).map((_, place) => (data[4 * place] + data[4 * place + 1] + data[4 * place + 2]) / 3);
    const middle = (side >> 1) * (side + 1);
    const seen = new Uint8Array(side * side);
    const stack = [middle];
    seen[middle] = 1;
    let [left, high, right, low] = [side, side, 0, 0];
    while (stack.length) {
      const place = stack.pop();
      const [column, row] = [place % side, Math.floor(place / side)];
      // It goes on outside of the window.
      if (!column || !row || column === side - 1 || row === side - 1) return null;
      [left, high, right, low] = [Math.min(left, column), Math.min(high, row), Math.max(right, column), Math.max(low, row)];
      for (const next of [place - 1, place + 1, place - side, place + side]) {
        if (seen[next] || Math.abs(grey[next] - grey[middle]) > ALIKE) continue;
        seen[next] = 1;
        stack.push(next);
      }
    }
    const [x1, x2] = [left - 1, right + 2].map((each) => corner[0] + each * CELL);
    const [y1, y2] = [low + 2, high - 1].map((each) => corner[1] - each * CELL);
    if (Math.min(x2 - x1, y2 - y1) < LEAST) return null;
    const sides = [[x1, (y1 + y2) / 2], [x2, (y1 + y2) / 2], [(x1 + x2) / 2, y1], [(x1 + x2) / 2, y2]];
    if (sides.filter((each) => this.wallWithin(each, BESIDE)).length >= ROOM_SIDES) return null;
    return [[x1, y1], [x2, y1], [x2, y2], [x1, y2]];
  }

  // Whether something stands within a distance [m] of a point [m].
  wallWithin([x, y], distance) {
    const { strokes, heights, ox, oy } = this.plan;
    return heights.some((height, row) => {
      if (!height) return false;
      const [x1, y1, x2, y2] = strokes.slice(4 * row, 4 * row + 4);
      const [east, north] = foot([x - ox, y - oy], [x1, y1], [x2, y2]);
      return Math.hypot(x - ox - east, y - oy - north) < distance;
    });
  }

  toScreen([x, y]) {
    const { view } = this;
    return [this.width / 2 + (x - view.x) * view.scale, this.height / 2 - (y - view.y) * view.scale];
  }

  toPlan([x, y]) {
    const { view } = this;
    return [view.x + (x - this.width / 2) / view.scale, view.y - (y - this.height / 2) / view.scale];
  }

  move(by) {
    Object.assign(this.view, { x: this.view.x - by[0] / this.view.scale, y: this.view.y + by[1] / this.view.scale });
    this.shift();
  }

  zoom(at, factor) {
    const before = this.toPlan(at);
    this.view.scale = Math.min(5000, Math.max(0.05, this.view.scale * factor));
    const after = this.toPlan(at);
    Object.assign(this.view, { x: this.view.x + before[0] - after[0], y: this.view.y + before[1] - after[1] });
    this.shift();
  }

  shift() {
    if ((this.plan?.kinds.length ?? 0) > MANY) this.still = performance.now() + CALM;
    this.stale(true);
  }

  // What was drawn is old: the drawing with all that was understood, or just what a tool is about.
  stale(base = false) {
    this.worn ||= base;
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw();
    });
  }

  draw() {
    if (!this.plan || !this.width) return;
    const left = this.still - performance.now();
    if (left > 0 && this.shown) {
      this.drawMoved();
      clearTimeout(this.later);
      this.later = setTimeout(() => this.stale(), left + 1);
    } else if (this.worn) this.drawBase();
    this.drawTop();
  }

  drawMoved() {
    const context = this.base.getContext("2d", PEN);
    const { view, shown } = this;
    const factor = view.scale / shown.view.scale;
    const [x, y] = this.toScreen([shown.view.x, shown.view.y]);
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    context.clearRect(0, 0, this.width, this.height);
    context.drawImage(shown.picture, x - (factor * this.width) / 2, y - (factor * this.height) / 2, factor * this.width, factor * this.height);
  }

  // Lines in metres about the origin of the plan.
  metres(context) {
    const { view, ratio, plan } = this;
    const scale = ratio * view.scale;
    const [x, y] = this.toScreen([plan.ox, plan.oy]);
    context.setTransform(scale, 0, 0, -scale, ratio * x, ratio * y);
  }

  drawBase() {
    const context = this.base.getContext("2d", PEN);
    const { plan, view } = this;
    const many = plan.kinds.length > MANY;
    this.worn = false;
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    context.clearRect(0, 0, this.width, this.height);
    this.drawGrid(context);
    if (this.picture && plan.sheet) {
      const [x, y] = this.toScreen([0, plan.sheet[1] * plan.unit]);
      const size = plan.sheet.map((side) => side * plan.unit * view.scale);
      context.globalAlpha = 0.42;
      context.drawImage(this.picture, x, y, ...size);
      context.globalAlpha = 1;
    }
    if (this.rooms) {
      const { corner, size, shape, picture } = this.rooms;
      const [x, y] = this.toScreen([corner[0], corner[1] + size * shape[1]]);
      context.imageSmoothingEnabled = false;
      context.drawImage(picture, x, y, size * shape[0] * view.scale, size * shape[1] * view.scale);
      context.imageSmoothingEnabled = true;
    }
    this.metres(context);
    context.lineCap = many ? "butt" : "round";
    for (const kind of ["nothing", "furniture", "door", "wall", "glass", "mirror"]) {
      context.strokeStyle = COLOURS[kind];
      context.lineWidth = (many && view.scale < NEAR ? 1 / this.ratio : WIDTHS[kind]) / view.scale;
      for (const path of plan.paths[plan.classes.indexOf(kind)]) context.stroke(path);
    }
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    for (const opening of [...plan.doors, ...plan.gaps]) this.line(context, opening, { colour: COLOURS.door, width: 2, dash: [5, 4] });
    // All are placed before the first is drawn: none is in the way of another.
    const names = (this.rooms?.rooms ?? []).map((room, place) => [place < MOST_PLACED ? this.bareNear(context, room) : this.toScreen(room.at), room, `R${place + 1}`]);
    for (const [at, { area, why }, name] of names) this.name(context, at, name, `${area.toFixed(1)} m²`, why && RED);
    if (many) {
      const picture = document.createElement("canvas");
      Object.assign(picture, { width: this.base.width, height: this.base.height });
      picture.getContext("2d", PEN).drawImage(this.base, 0, 0);
      this.shown = { picture, view: { ...view } };
    }
  }

  // Metres as a fine grid, where they are wide enough, and a bar that is as long as its number says.
  drawGrid(context) {
    const { view } = this;
    const step = [0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500].find((each) => each * view.scale > 70) ?? 1000;
    const [x1, y2] = this.toPlan([0, 0]);
    const [x2, y1] = this.toPlan([this.width, this.height]);
    context.strokeStyle = "rgba(40, 55, 80, 0.07)";
    context.lineWidth = 1;
    context.beginPath();
    for (let x = Math.ceil(x1 / step) * step; x < x2; x += step) this.run(context, [[x, y1], [x, y2]]);
    for (let y = Math.ceil(y1 / step) * step; y < y2; y += step) this.run(context, [[x1, y], [x2, y]]);
    context.stroke();
    const long = step * view.scale;
    context.fillStyle = context.strokeStyle = "#5b6b84";
    context.lineWidth = 1.5;
    context.beginPath();
    context.moveTo(this.width - 24 - long, this.height - 22);
    context.lineTo(this.width - 24 - long, this.height - 17);
    context.lineTo(this.width - 24, this.height - 17);
    context.lineTo(this.width - 24, this.height - 22);
    context.stroke();
    context.font = "12px DejaVu Sans, sans-serif";
    context.textAlign = "center";
    context.fillText(`${step} m`, this.width - 24 - long / 2, this.height - 23);
  }

  run(context, points) {
    points.forEach((point, place) => context[place ? "lineTo" : "moveTo"](...this.toScreen(point)));
  }

  line(context, points, { colour, width = 2, dash = [], closed = false, fill = null }) {
    context.beginPath();
    this.run(context, points);
    if (closed) context.closePath();
    if (fill) {
      context.fillStyle = fill;
      context.fill();
    }
    Object.assign(context, { strokeStyle: colour, lineWidth: width, lineCap: "round", lineJoin: "round" });
    context.setLineDash(dash);
    context.stroke();
    context.setLineDash([]);
  }

  // Many strokes at once, by their ends; those that are not in view are left out.
  lines(context, strokes, colour, width) {
    const fine = strokes.length > MANY;
    Object.assign(context, { strokeStyle: colour, lineWidth: fine ? 1.5 : width, lineCap: fine ? "butt" : "round" });
    const [x1, y2] = this.toPlan([0, 0]);
    const [x2, y1] = this.toPlan([this.width, this.height]);
    const seen = strokes.filter(([[a, b], [c, d]]) => Math.max(a, c) > x1 && Math.min(a, c) < x2 && Math.max(b, d) > y1 && Math.min(b, d) < y2);
    for (let first = 0; first < seen.length; first += CHUNK) {
      context.beginPath();
      for (const ends of seen.slice(first, first + CHUNK)) this.run(context, ends);
      context.stroke();
    }
  }

  dot(context, point, colour, radius = 5, text = "") {
    const [x, y] = this.toScreen(point);
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.fillStyle = colour;
    context.fill();
    Object.assign(context, { strokeStyle: "#fff", lineWidth: 1.5, textAlign: "center", textBaseline: "middle", font: "bold 11px sans-serif" });
    context.stroke();
    context.fillStyle = "#fff";
    context.fillText(text, x, y + 0.5);
    context.textBaseline = "alphabetic";
  }

  ring(context, point, colour, metres) {
    const [x, y] = this.toScreen(point);
    context.beginPath();
    context.arc(x, y, Math.max(13, metres * this.view.scale + 4), 0, 2 * Math.PI);
    Object.assign(context, { strokeStyle: colour, lineWidth: 4 });
    context.stroke();
  }

  // Where the name of a room is drawn: of some places on the screen near its middle, the first where least is drawn.
  bareNear(context, room) {
    const [x, y] = this.toScreen(room.at);
    const inside = x > 90 && y > 70 && x < this.width - 90 && y < this.height - 70;
    if (inside && room.scale !== this.view.scale) Object.assign(room, { scale: this.view.scale, by: this.bareBy(context, x, y) });
    const [dx, dy] = room.by ?? [0, 0];
    return [x + dx, y + dy];
  }

  bareBy(context, x, y) {
    const darkness = ([dx, dy]) => {
      const { data } = context.getImageData((x + dx - 24) * this.ratio, (y + dy - 14) * this.ratio, 48 * this.ratio, 32 * this.ratio);
      let [high, sum] = [0, 0];
      for (let cell = 0; cell < data.length; cell += 4) {
        const grey = data[cell] + data[cell + 1] + data[cell + 2];
        high = Math.max(high, grey);
        sum += grey;
      }
      return high - (4 * sum) / data.length;
    };
    const places = [0, 22, -22, 44, -44].flatMap((dy) => [0, 30, -30, 60, -60].map((dx) => [dx, dy]));
    // A place further off must be clearly better.
    return places.map((by) => [darkness(by) + 0.05 * Math.hypot(...by), by]).reduce((one, two) => (two[0] < one[0] - 3 ? two : one))[1];
  }

  // The name of a room, and its area below.
  name(context, [x, y], name, area, colour) {
    Object.assign(context, { fillStyle: colour || "rgba(122, 78, 12, 0.8)", textAlign: "center" });
    Object.assign(context, { strokeStyle: "rgba(255, 248, 235, 0.8)", lineWidth: 3, lineJoin: "round" });
    for (const [text, size, down] of [[name, "bold 12px", 0], [area, "10px", 13]]) {
      context.font = `${size} DejaVu Sans, sans-serif`;
      context.strokeText(text, x, y + down);
      context.fillText(text, x, y + down);
    }
  }

  label(context, point, text, colour = "#1c2534") {
    context.font = "600 13px DejaVu Sans, sans-serif";
    const wide = context.measureText(text).width + 12;
    const at = this.toScreen(point);
    const [x, y] = [Math.min(at[0], this.width - wide - 16), Math.max(at[1], 34)];
    context.fillStyle = "rgba(255, 255, 255, 0.92)";
    context.beginPath();
    context.roundRect(x + 12, y - 30, wide, 22, 5);
    context.fill();
    context.fillStyle = colour;
    context.textAlign = "left";
    context.fillText(text, x + 18, y - 14);
  }

  drawRobot(context, [x, y, degrees], radius, colour = ORANGE) {
    const angle = (degrees * Math.PI) / 180;
    const [cx, cy] = this.toScreen([x, y]);
    const size = Math.max(7, radius * this.view.scale);
    context.beginPath();
    context.arc(cx, cy, size, 0, 2 * Math.PI);
    Object.assign(context, { fillStyle: colour, strokeStyle: "#fff", lineWidth: 2 });
    context.fill();
    context.stroke();
    context.beginPath();
    context.moveTo(cx + size * Math.cos(angle), cy - size * Math.sin(angle));
    for (const turn of [2.5, -2.5]) context.lineTo(cx + 0.6 * size * Math.cos(angle + turn), cy - 0.6 * size * Math.sin(angle + turn));
    context.closePath();
    context.fillStyle = "#fff";
    context.fill();
  }

  drawBeams(context) {
    const { beams, robot } = this;
    if (!beams || !robot) return;
    const here = robot.slice(0, 2);
    const area = [here];
    context.beginPath();
    for (let beam = 0; beam < beams.length; beam += 4) {
      const met = [beams[beam], beams[beam + 1]];
      area.push(met);
      if (Math.hypot(beams[beam + 2] - met[0], beams[beam + 3] - met[1]) > 1e-4) this.run(context, [met, [beams[beam + 2], beams[beam + 3]]]);
    }
    Object.assign(context, { strokeStyle: "rgba(143, 95, 208, 0.5)", lineWidth: 1 });
    context.stroke();
    context.beginPath();
    for (const met of area) this.run(context, [here, met]);
    Object.assign(context, { strokeStyle: "rgba(240, 124, 20, 0.28)", lineWidth: 1 });
    context.stroke();
    this.line(context, area, { colour: "rgba(240, 124, 20, 0)", closed: true, fill: "rgba(245, 166, 35, 0.16)" });
    context.fillStyle = "#d6400d";
    for (let beam = 0; beam < beams.length; beam += 4) {
      const [x, y] = this.toScreen([beams[beam + 2], beams[beam + 3]]);
      context.fillRect(x - 1.5, y - 1.5, 3, 3);
    }
  }

  // What was decided, and what a tool is about.
  drawTop() {
    const context = this.top.getContext("2d");
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    context.clearRect(0, 0, this.width, this.height);
    const { plan } = this;
    const edits = this.held ?? plan.edits;
    for (const { points } of edits.keep_out ?? []) this.line(context, points, { colour: "#d9480f", width: 1.5, dash: [6, 4], closed: true, fill: "rgba(217, 72, 15, 0.13)" });
    for (const each of edits.obstacle ?? []) {
      this.line(context, each.route, { colour: "#c2255c", width: 1.5, dash: [2, 4] });
      const [x, y] = this.toScreen(each.route[0]);
      context.beginPath();
      context.arc(x, y, Math.max(5, (each.radius ?? 0.3) * this.view.scale), 0, 2 * Math.PI);
      context.fillStyle = "rgba(194, 37, 92, 0.75)";
      context.fill();
    }
    if (this.route) this.line(context, this.route, { colour: ORANGE, width: 2.5, dash: [1, 6] });
    this.drawBeams(context);
    (edits.robot?.route ?? []).forEach((goal, place) => {
      const why = this.doubts[place];
      this.dot(context, goal, why ? RED : "#2b6cb0", 9, String(place + 1));
      if (why) this.label(context, goal, why, RED);
    });
    const pose = this.robot ?? edits.robot?.start;
    if (pose) this.drawRobot(context, pose, this.plan.radius);
    this.drawTool?.(context);
  }
}

// Rooms as a picture: warm where the robot comes, hatched where it does not.
export function roomsPicture({ corner, size, shape, rooms }, cells) {
  const [columns, rows] = shape;
  const data = new ImageData(columns, rows);
  for (let column = 0; column < columns; column += 1) {
    for (let row = 0; row < rows; row += 1) {
      const label = cells[column * rows + row];
      if (!label) continue;
      const hatched = (column + row) % 6 < 2;
      data.data.set(label === 1 ? [245, 166, 35, 34] : [205, 60, 40, hatched ? 90 : 26], 4 * ((rows - 1 - row) * columns + column));
    }
  }
  const picture = document.createElement("canvas");
  Object.assign(picture, { width: columns, height: rows });
  picture.getContext("2d").putImageData(data, 0, 0);
  return { corner, size, shape, rooms, picture };
}
