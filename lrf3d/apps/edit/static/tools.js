// The tools: what clicks, drags and keys decide. A tool changes a copy of the decisions, which the editor keeps.

import { COLOURS, LOW, foot } from "./sheet.js";

const REACH = 9; // Distance within which something is pointed at [pixels].
const BELOW = 2; // Distance by which what stands may be farther than what is left out [pixels].
const away = ([x1, y1], [x2, y2]) => Math.hypot(x2 - x1, y2 - y1);
const rounded = (point) => point.map((each) => Math.round(1e4 * each) / 1e4);
const metres = (length) => `${length.toFixed(2)} m`;

// The share of the boxes around two outlines that they have in common.
export function overlap(one, two) {
  const common = [0, 1].map((axis) => {
    const [a, b] = [one, two].map((points) => points.map((point) => point[axis]));
    const both = Math.min(Math.max(...a), Math.max(...b)) - Math.max(Math.min(...a), Math.min(...b));
    return Math.max(0, both) / (Math.max(...a, ...b) - Math.min(...a, ...b) || 1);
  });
  return common[0] * common[1];
}

// Where two lines cross, however short they are; nothing if they are parallel.
function crossing([[x1, y1], [x2, y2]], [[x3, y3], [x4, y4]]) {
  const turn = (x2 - x1) * (y4 - y3) - (y2 - y1) * (x4 - x3);
  const share = ((x3 - x1) * (y4 - y3) - (y3 - y1) * (x4 - x3)) / turn;
  return Math.abs(turn) > 1e-9 ? [x1 + share * (x2 - x1), y1 + share * (y2 - y1)] : null;
}

// Lines of the plan and of what is drawn, by their rows.
export class Finder {
  constructor(sheet) {
    this.sheet = sheet;
  }

  ends(row) {
    const { strokes, ox, oy } = this.sheet.plan;
    return [
      [strokes[4 * row] + ox, strokes[4 * row + 1] + oy],
      [strokes[4 * row + 2] + ox, strokes[4 * row + 3] + oy],
    ];
  }

  // The nearest stroke to a point [m], of those that fit.
  stroke(point, fits = () => true) {
    const { strokes, kinds, heights, ox, oy } = this.sheet.plan;
    const { scale } = this.sheet.view;
    const [x, y] = [point[0] - ox, point[1] - oy];
    let [best, least] = [-1, REACH / scale];
    for (let row = 0; row < kinds.length; row += 1) {
      const [x1, y1, x2, y2] = [strokes[4 * row], strokes[4 * row + 1], strokes[4 * row + 2], strokes[4 * row + 3]];
      if (Math.min(x1, x2) - least > x || Math.max(x1, x2) + least < x || Math.min(y1, y2) - least > y || Math.max(y1, y2) + least < y) continue;
      // What is left out lies below what stands. Of two at one place the last one is on top.
      const below = heights[row] > 0 ? 0 : BELOW / scale;
      const off = away([x, y], foot([x, y], [x1, y1], [x2, y2])) + below;
      if (off <= least && fits(row)) [best, least] = [row, off];
    }
    return best;
  }

  // The nearest point of the grid: decimetres, centimetres where those are wide, metres or what is given where they are narrow.
  onGrid(point, coarse = 1) {
    const { plan, view } = this.sheet;
    const step = view.scale > 250 ? 0.01 : view.scale > 20 ? 0.1 : coarse;
    return plan.scaled ? point.map((each) => Math.round(each / step) * step) : point;
  }

  // Where a point is drawn to: ends, lines, right angles to a point before it, and the grid.
  snap(point, last, before, grid = true) {
    const reach = REACH / this.sheet.view.scale;
    const { strokes, ox, oy } = this.sheet.plan;
    let [best, least] = [null, reach];
    for (let end = 0; end < strokes.length; end += 2) {
      const off = Math.hypot(strokes[end] + ox - point[0], strokes[end + 1] + oy - point[1]);
      if (off < least) [best, least] = [[strokes[end] + ox, strokes[end + 1] + oy], off];
    }
    if (best) return { point: best, to: "end" };
    if (last) {
      // Right angles to the sheet, and to the wall that was drawn before.
      const turns = [0, Math.PI / 2];
      if (before) turns.push(Math.atan2(last[1] - before[1], last[0] - before[0]), Math.atan2(last[1] - before[1], last[0] - before[0]) + Math.PI / 2);
      for (const turn of turns) {
        const way = [Math.cos(turn), Math.sin(turn)];
        const along = (point[0] - last[0]) * way[0] + (point[1] - last[1]) * way[1];
        const off = Math.abs((point[0] - last[0]) * way[1] - (point[1] - last[1]) * way[0]);
        const long = grid ? this.onGrid([along])[0] : along;
        if (off < least) [best, least] = [[last[0] + long * way[0], last[1] + long * way[1]], off];
      }
    }
    const row = this.stroke(point);
    // A right angle ends at the line that is pointed at.
    const met = best && row >= 0 && crossing([last, best], this.ends(row));
    if (met && away(met, point) < 2 * reach) return { point: met, to: "line" };
    if (best) return { point: best, to: "angle" };
    if (row >= 0) return { point: foot(point, ...this.ends(row)), to: "line" };
    return { point: grid ? this.onGrid(point) : point, to: "" };
  }
}

export function makeTools(editor) {
  const { sheet, finder } = editor;
  const unit = () => sheet.plan.unit;
  const inUnits = (point) => rounded(point.map((each) => each / unit()));
  const stands = (row) => sheet.plan.heights[row] > 0;
  const drawn = (row) => sheet.plan.rules[sheet.plan.rulesOf[row]] === "drawn";
  const middle = (row) => {
    const [one, two] = finder.ends(row);
    return [(one[0] + two[0]) / 2, (one[1] + two[1]) / 2];
  };

  // The wall that was decided of which a stroke is a part: its number, and that of its side. The last one is on top.
  function wallOf(row) {
    if (row < 0 || !drawn(row)) return null;
    const at = middle(row);
    const { wall = [] } = sheet.plan.edits;
    for (let number = wall.length - 1; number >= 0; number -= 1) {
      const { points } = wall[number];
      for (let piece = 0; piece < points.length - (wall[number].closed ? 0 : 1); piece += 1) {
        if (away(at, foot(at, points[piece], points[(piece + 1) % points.length])) < 0.003) return { table: "wall", number, piece };
      }
    }
    return null;
  }

  // What was decided at a point: its table, its number, and the number of its point; else a side of a wall.
  function decided(point, row, ends = false) {
    const reach = (REACH + 3) / sheet.view.scale;
    const { edits } = sheet.plan;
    const found = [];
    const near = (table, number, points, size = 0) => points.forEach((each, place) => found.push({ table, number, place, off: away(point, each) / Math.max(reach, size) }));
    if (edits.robot?.start) near("robot.start", 0, [edits.robot.start.slice(0, 2)], sheet.plan.radius);
    near("robot.route", 0, edits.robot?.route ?? []);
    if (ends) (edits.wall ?? []).forEach(({ points }, number) => near("wall", number, points));
    (edits.doorway ?? []).forEach(({ at, width }, number) => near("doorway", number, [at], 0.4 * width));
    (edits.keep_out ?? []).forEach(({ points }, number) => near("keep_out", number, points));
    (edits.obstacle ?? []).forEach(({ route, radius }, number) => {
      near("obstacle", number, route.slice(0, 1), radius ?? 0.3);
      near("obstacle", number, route);
    });
    const best = found.sort((a, b) => a.off - b.off)[0];
    if (best?.off < 1) return best;
    const wall = wallOf(row);
    if (wall) return { ...wall, point: foot(point, ...pieceOf(wall)) };
    const area = (edits.keep_out ?? []).findIndex(({ points }) => points.some((each, place) => away(point, foot(point, each, points[(place + 1) % points.length])) < reach));
    return area >= 0 && row < 0 ? { table: "keep_out", number: area } : null;
  }

  const pointsOf = (edits, { table, number }) => {
    if (table === "robot.start") return [edits.robot.start.slice(0, 2)];
    if (table === "robot.route") return edits.robot.route;
    if (table === "doorway") return [edits.doorway[number].at];
    return edits[table][number][table === "obstacle" ? "route" : "points"];
  };

  const boxSize = ([one, , three]) => `${Math.abs(three[0] - one[0]).toFixed(2)} × ${metres(Math.abs(three[1] - one[1]))}`;

  // The corners of the furniture at a point that was left out of a picture, if there is some.
  function thingAt(point, row) {
    if (!sheet.plan.picture || (row >= 0 && stands(row))) return null;
    const found = sheet.furnitureAt(point);
    const boxes = (sheet.plan.edits.wall ?? []).filter(isBox);
    return found && boxes.every((box) => overlap(box.points, found) < 0.5) ? found : null;
  }

  // A side of a box means all of it.
  const isBox = ({ closed, height }) => closed && height < LOW;
  const whole = (one) => (one?.table === "wall" && isBox(sheet.plan.edits.wall[one.number]) ? { table: "wall", number: one.number } : one);

  const exists = (one) => {
    const { edits } = sheet.plan;
    if (one.table === "robot.start") return Boolean(edits.robot?.start);
    if (one.table === "robot.route") return one.place < (edits.robot?.route?.length ?? 0);
    return one.number < (edits[one.table]?.length ?? 0) && (one.piece ?? 0) < pointsOf(edits, one).length;
  };

  // What something that was decided is called.
  function named(one) {
    const { edits } = sheet.plan;
    if (one.table === "wall") {
      const { points, material, height, closed } = edits.wall[one.number];
      const kind = height < LOW ? `box or low wall of ${height} m` : material ?? "wall";
      if (one.piece === undefined) return `${closed ? "all sides" : "the whole"}: ${kind}`;
      return `${points.length > 2 ? "one side, " : ""}${metres(away(...pieceOf(one)))}: ${kind} (drawn)`;
    }
    const names = { "robot.start": "where the robot starts", "robot.route": `goal ${one.place + 1}`, doorway: "a doorway that was cut", keep_out: "an area that routes avoid", obstacle: "an obstacle" };
    return names[one.table];
  }

  // Where something is that was decided.
  function mark(context, one, colour) {
    const { edits } = sheet.plan;
    if (!exists(one)) return;
    if (one.table === "wall") {
      const { points, closed } = edits.wall[one.number];
      return one.piece === undefined ? sheet.line(context, points, { colour, width: 5, closed }) : sheet.line(context, pieceOf(one), { colour, width: 5 });
    }
    const points = pointsOf(edits, one);
    if (["keep_out", "obstacle"].includes(one.table)) sheet.line(context, points, { colour, width: 3, closed: one.table === "keep_out" });
    const sizes = { "robot.start": sheet.plan.radius, doorway: edits.doorway?.[one.number]?.width / 2, obstacle: edits.obstacle?.[one.number]?.radius ?? 0.3 };
    if (one.table !== "keep_out") sheet.ring(context, points[one.table === "robot.route" ? one.place : 0], colour, sizes[one.table] ?? 0);
  }

  // Whether an obstacle stands: its way is one place.
  const stays = ({ route }) => route.every((each) => away(each, route[0]) === 0);

  function moveDecided(edits, one, to) {
    if (one.table === "robot.start") edits.robot.start = [...rounded(to), edits.robot.start[2]];
    else if (one.table === "doorway") edits.doorway[one.number].at = rounded(to);
    else if (one.table === "obstacle" && stays(edits.obstacle[one.number])) edits.obstacle[one.number].route.fill(rounded(to));
    else pointsOf(edits, one)[one.place] = rounded(to);
  }

  function deleteDecided(edits, one) {
    const drop = (table, number) => {
      edits[table].splice(number, 1);
      if (!edits[table].length) delete edits[table];
    };
    if (one.table === "robot.start") delete edits.robot.start;
    else if (one.table === "robot.route") edits.robot.route.splice(one.place, 1);
    else if (one.table === "wall" && one.piece !== undefined) erasePiece(edits, one, drop);
    else drop(one.table, one.number);
    if (edits.robot && !edits.robot.route?.length) delete edits.robot.route;
    if (edits.robot && !Object.keys(edits.robot).length) delete edits.robot;
  }

  // The two ends of a piece of a polyline.
  const pieceOf = ({ number, piece }) => {
    const { points } = sheet.plan.edits.wall[number];
    return [points[piece], points[(piece + 1) % points.length]];
  };

  // A piece of a polyline goes, or what lies between two places on it; what is left of it stays.
  function erasePiece(edits, { number, piece, between }, drop) {
    const { closed, ...wall } = edits.wall[number];
    const { points } = wall;
    const [from, to] = (between ?? []).sort((one, two) => away(one, points[piece]) - away(two, points[piece]));
    const before = [...points.slice(0, piece + 1), ...(from ? [from] : [])];
    const after = [...(to ? [to] : []), ...points.slice(piece + 1)];
    const long = (line) => line.slice(1).some((each) => away(each, line[0]) > 0.002);
    const parts = (closed ? [[...after, ...before]] : [before, after]).filter(long);
    if (!parts.length) drop("wall", number);
    else edits.wall.splice(number, 1, ...parts.map((part) => ({ ...wall, points: part })));
  }

  const boxed = (from, to) => [from, [to[0], from[1]], to, [from[0], to[1]]];

  const hasArea = (from, to) => Math.min(Math.abs(to[0] - from[0]), Math.abs(to[1] - from[1])) >= 0.05;

  // Tools that take points until Enter, or until a line comes back to its beginning. Some keep what is drawn when they are left.
  const polyline = (keep, least, closes, word, { alone = "", keeps = false }) => ({
    points: [],
    typed: "",
    start() {
      this.points = [];
      this.typed = "";
    },
    leave() {
      if (keeps) this.finish(false);
    },
    at(event) {
      // The corner across from the first one lies in any direction from it.
      const last = this.drags(event) ? undefined : this.points.at(-1);
      let { point, to } = event.altKey ? { point: event.point, to: "" } : finder.snap(event.point, last, this.points.at(-2));
      const first = this.points[0];
      if (first && this.points.length >= 3 && away(event.point, first) < (REACH + 2) / sheet.view.scale) [point, to] = [first, "close"];
      if (last && this.typed && Number(this.typed) > 0) {
        const factor = Number(this.typed) / (away(point, last) || 1);
        point = [last[0] + factor * (point[0] - last[0]), last[1] + factor * (point[1] - last[1])];
      }
      return { point, to };
    },
    move(event) {
      this.event = event;
      this.now = this.at(event);
    },
    down(event) {
      const { point, to } = this.at(event);
      this.pressed = event.at;
      this.typed = "";
      const last = this.points.at(-1);
      const again = last && away(point, last) * sheet.view.scale < 4;
      if (to === "close" || again) return this.finish(to === "close");
      this.points.push(point);
      return true;
    },
    // An area may be dragged from corner to corner, too.
    up(event) {
      const { point } = this.at(event);
      if (this.drags(event) && hasArea(this.points[0], point)) {
        this.points = boxed(this.points[0], point);
        this.finish(true);
      }
      this.pressed = null;
    },
    drags(event) {
      return closes && this.pressed && this.points.length === 1 && away(event.at, this.pressed) > 6;
    },
    key({ key }) {
      if (key === "Enter" && this.typed && this.now) {
        this.points.push(this.at(this.event).point);
        this.typed = "";
      } else if (key === "Enter") this.finish(false);
      else if (key === "Backspace") this.typed ? (this.typed = this.typed.slice(0, -1)) : this.points.pop();
      else if (this.points.length && /^[\d.,]$/.test(key)) this.typed += key.replace(",", ".");
      else return false;
      if (this.event && (this.now || this.typed)) this.now = this.at(this.event);
      return true;
    },
    finish(closed) {
      const points = this.points.filter((point, place) => !place || away(point, this.points[place - 1]) > 0.002).map(rounded);
      this.start();
      if (points.length >= least) editor.change(`${word} drawn`, (edits) => keep(edits, points, closed));
    },
    draw(context) {
      const { points, now } = this;
      const box = now && this.drags(this.event);
      const line = box ? boxed(points[0], now.point) : [...points, ...(now ? [now.point] : [])];
      sheet.line(context, line, { colour: "#f07c14", width: 2.5, closed: box || (closes && points.length > 1) });
      if (!now) return;
      sheet.dot(context, now.point, now.to ? "#37a350" : "#f07c14", 4.5);
      if (!points.length) return;
      const long = away(points.at(-1), now.point);
      const still = long * sheet.view.scale < 4;
      if (box) sheet.label(context, now.point, boxSize(line));
      else if (!still || this.typed) sheet.label(context, now.point, this.typed ? `${this.typed}▏ m` : metres(long), now.to === "angle" ? "#2b8a3e" : "#1c2534");
      else if (alone && points.length === 1) sheet.label(context, now.point, alone);
    },
  });

  // Tools that take a rectangle: dragged, by two clicks, or with its width and height typed.
  const rectangle = (what, style) => ({
    start() {
      Object.assign(this, { from: null, to: null, typed: ["", ""], axis: 0 });
    },
    at(event) {
      const point = event.altKey ? event.point : finder.snap(event.point).point;
      if (!this.from) return point;
      return point.map((each, axis) => {
        const long = Number(this.typed[axis]);
        return long > 0 ? this.from[axis] + (each < this.from[axis] ? -long : long) : each;
      });
    },
    move(event) {
      this.event = event;
      this.now = this.at(event);
      if (this.from) this.to = this.now;
    },
    down(event) {
      this.move(event);
      if (this.from) return this.finish();
      Object.assign(this, { from: this.now, to: this.now, pressed: event.at });
    },
    up(event) {
      this.move(event);
      if (this.from && away(event.at, this.pressed) > 6) this.finish();
    },
    key({ key }) {
      if (!this.from) return false;
      const { typed, axis } = this;
      if (key === "Enter") this.finish();
      else if (key === "Tab") this.axis = 1 - axis;
      else if (key === "Backspace") typed[axis] = typed[axis].slice(0, -1);
      else if (/^[\d.,]$/.test(key)) typed[axis] += key.replace(",", ".");
      else return false;
      if (this.from) this.move(this.event);
      return true;
    },
    finish() {
      const { from, to } = this;
      this.start();
      if (!hasArea(from, to)) return;
      editor.change(`${what} drawn`, (edits) => (edits.wall ??= []).push({ points: boxed(from, to).map(rounded), closed: true, ...style() }));
    },
    draw(context) {
      if (this.from) {
        const size = this.typed.map((typed, axis) => (typed || axis !== this.axis ? typed : "") || Math.abs(this.to[axis] - this.from[axis]).toFixed(2));
        size[this.axis] += this.typed.some(Boolean) ? "▏" : "";
        sheet.line(context, boxed(this.from, this.to), { colour: "#f07c14", width: 2.5, closed: true });
        sheet.label(context, this.to, `${size.join(" × ")} m`);
      }
      if (this.now) sheet.dot(context, this.now, "#f07c14", 4.5);
    },
  });

  return {
    select: {
      cursor: "default",
      get hint() {
        const what = sheet.plan?.empty ? "click a wall to change it" : "click what was understood wrongly, or drag around it; then say what it is";
        return `${what}; robot, goals and ends of walls can be dragged`;
      },
      exists,
      named,
      drop: deleteDecided,
      stays,
      says() {
        if (this.one && exists(this.one)) return named(this.one);
        const thing = this.thing ? `${boxSize(this.thing)} left out: click it, then 2 makes it furniture` : "";
        return [this.over >= 0 && editor.described(this.over), thing].filter(Boolean).join(" · ");
      },
      down(event) {
        const row = finder.stroke(event.point);
        const one = decided(event.point, row, true);
        // With Shift strokes are picked one after another, furniture or not.
        const thing = one || event.shiftKey ? null : thingAt(event.point, row);
        const whole = one?.table === "wall" && event.twice && { one: { table: "wall", number: one.number } };
        if (whole) return editor.pick(whole);
        if (one && one.place !== undefined) return (this.drag = { one, edits: structuredClone(sheet.plan.edits) });
        if (one) editor.pick({ one, point: one.point });
        else if (row >= 0 && !thing) {
          const end = finder.ends(row).find((each) => away(each, event.point) < REACH / sheet.view.scale);
          const picked = event.shiftKey && editor.picked?.rows ? [...editor.picked.rows, row] : [row];
          editor.pick({ rows: picked });
          const grabs = end && stands(row) && editor.wasPicked === row;
          editor.wasPicked = row;
          if (grabs) return (this.drag = { end });
        }
        this.drag = { around: [event.point], lasso: event.altKey, row, thing };
      },
      move(event) {
        const { drag } = this;
        this.over = drag ? -1 : finder.stroke(event.point);
        this.one = drag ? null : decided(event.point, this.over);
        this.thing = drag || this.one ? null : thingAt(event.point, this.over);
        if (!drag) return;
        drag.moved = true;
        if (drag.around) drag.around = drag.lasso ? [...drag.around, event.point] : [drag.around[0], event.point];
        else drag.to = event.altKey ? event.point : finder.snap(event.point).point;
        if (drag.one?.table === "robot.start") editor.scan([...drag.to, drag.edits.robot.start[2]]);
      },
      up(event) {
        const { drag } = this;
        this.drag = null;
        if (!drag) return;
        if (drag.around && drag.around.some((each) => away(each, drag.around[0]) * sheet.view.scale > 4)) {
          const area = drag.lasso ? drag.around : boxed(...drag.around);
          editor.pick({ inside: area.map(inUnits), area, exact: drag.lasso });
        } else if (drag.thing) editor.pick({ inside: drag.thing.map(inUnits), area: drag.thing, exact: true });
        else if (drag.around) drag.row < 0 && editor.pick(null);
        else if (drag.one && !drag.moved) {
          // At the end of a wall its side is meant.
          const one = drag.one.table === "wall" ? decided(event.point, finder.stroke(event.point)) : drag.one;
          if (one) editor.pick({ one, point: one.point });
        }
        else if (drag.one) editor.change("moved", (edits) => moveDecided(edits, drag.one, drag.to));
        else if (drag.to) editor.change("an end moved", (edits) => (edits.move ??= []).push({ end: drag.end, to: rounded(drag.to) }));
      },
      draw(context) {
        const { drag } = this;
        if (editor.picked?.rows) sheet.lines(context, editor.rowsLike().map((row) => finder.ends(row)), "#f5a623", 5);
        if (editor.picked?.area) sheet.line(context, editor.picked.area, { colour: "#f5a623", width: 2, closed: true, fill: "rgba(245, 166, 35, 0.12)" });
        const one = editor.picked?.one;
        if (one && exists(one)) {
          mark(context, one, "#f5a623");
          for (const point of one.table === "wall" ? (one.piece === undefined ? pointsOf(sheet.plan.edits, one) : pieceOf(one)) : []) sheet.dot(context, point, "#f5a623", 4.5);
        }
        if (this.one && !drag) mark(context, this.one, "rgba(245, 166, 35, 0.55)");
        else if (this.thing && !drag) sheet.line(context, this.thing, { colour: "rgba(245, 166, 35, 0.75)", width: 3, closed: true });
        else if (this.over >= 0 && !drag) sheet.line(context, finder.ends(this.over), { colour: "rgba(245, 166, 35, 0.55)", width: 5 });
        if (drag?.around) sheet.line(context, drag.lasso ? drag.around : boxed(drag.around[0], drag.around.at(-1)), { colour: "#f5a623", width: 1.5, dash: [4, 4], closed: true });
        if (drag?.to) sheet.dot(context, drag.to, "#f5a623", 6);
      },
      key({ key }) {
        const classes = ["wall", "furniture", "glass", "mirror", "door", "nothing"];
        if (classes[key - 1] && editor.picked && !editor.picked.one) editor.classify(classes[key - 1]);
        else if (classes[key - 1] && editor.picked?.one.table === "wall") editor.make(classes[key - 1]);
        else if (["Delete", "Backspace"].includes(key) && editor.picked?.one) {
          const { one } = editor.picked;
          editor.change("deleted", (edits) => deleteDecided(edits, one));
          editor.pick(null);
        }
        else if (["Delete", "Backspace"].includes(key) && editor.picked) editor.classify("nothing");
        else return false;
        return true;
      },
    },
    scale: {
      cursor: "crosshair",
      hint: "click the two ends of something whose length you know, such as a door",
      start() {
        this.ends = [];
      },
      move(event) {
        this.now = event.altKey ? event.point : finder.snap(event.point, this.ends[0], null, false).point;
      },
      down(event) {
        this.move(event);
        if (this.ends.length > 1) this.ends = [];
        this.pressed = event.at;
        this.take();
      },
      // Released elsewhere, it was a drag from end to end.
      up(event) {
        this.move(event);
        if (this.ends.length === 1 && away(event.at, this.pressed) > 6) this.take();
      },
      take() {
        this.ends.push(this.now);
        // An empty sheet is in metres: there it only measures.
        if (this.ends.length === 2 && !sheet.plan.empty) editor.ask({ between: this.ends.map(inUnits), why: "the length of this", metres: null });
      },
      draw(context) {
        const line = this.ends.length === 1 && this.now ? [this.ends[0], this.now] : this.ends;
        if (line.length > 1) sheet.line(context, line, { colour: "#37a350", width: 3 });
        for (const end of [...this.ends, ...(this.now ? [this.now] : [])]) sheet.dot(context, end, "#37a350", 4.5);
        if (line.length > 1) sheet.label(context, line[1], sheet.plan.scaled ? metres(away(...line)) : "? m");
      },
    },
    wall: {
      cursor: "crosshair",
      hint: "click the corners; digits set a length; Enter ends, the first corner closes",
      ...polyline((edits, points, closed) => (edits.wall ??= []).push({ points, ...(closed && { closed: true }), ...editor.style }), 2, false, "a wall", { keeps: true }),
    },
    room: {
      cursor: "crosshair",
      hint: "drag from corner to corner, or click two; digits set its width, Tab, then its depth",
      ...rectangle("a room", () => editor.style),
    },
    box: {
      cursor: "crosshair",
      hint: "a box, such as a cupboard: drag from corner to corner, or click two; digits, Tab, digits set its sides",
      ...rectangle("a box", () => ({ height: editor.boxHeight })),
    },
    door: {
      cursor: "crosshair",
      hint: "click a wall; the width is that of the field on the left",
      says() {
        return this.gap ? "this gap is a door already: nothing needs to be cut" : "";
      },
      move(event) {
        const row = finder.stroke(event.point, stands);
        const { doors, gaps } = sheet.plan;
        this.now = null;
        this.gap = row < 0 && [...doors, ...gaps].some((ends) => away(event.point, foot(event.point, ...ends)) < 0.3);
        if (row < 0) return;
        const [one, two] = finder.ends(row);
        const long = away(one, two) || 1;
        const near = event.altKey ? event.point : finder.onGrid(event.point, 0.1);
        this.now = { at: foot(near, one, two), way: [(two[0] - one[0]) / long, (two[1] - one[1]) / long] };
      },
      down(event) {
        this.move(event);
        const { now } = this;
        if (now) editor.change("a doorway cut", (edits) => (edits.doorway ??= []).push({ at: rounded(now.at), width: editor.doorWidth }));
        else if (!this.gap) editor.note("no wall here to cut a door into");
      },
      draw(context) {
        if (!this.now) return;
        const { at, way } = this.now;
        const half = editor.doorWidth / 2;
        const ends = [-half, half].map((by) => [at[0] + by * way[0], at[1] + by * way[1]]);
        sheet.line(context, ends, { colour: COLOURS.door, width: 7 });
        sheet.label(context, at, metres(editor.doorWidth), "#2b8a3e");
      },
    },
    erase: {
      cursor: "crosshair",
      hint: "click what is to go; drag along a wall to take a piece of it",
      says() {
        return this.one && exists(this.one) ? named(this.one) : this.over >= 0 ? editor.described(this.over) : "";
      },
      move(event) {
        const { from } = this;
        const row = from ? -1 : finder.stroke(event.point, stands);
        this.one = from ? null : whole(decided(event.point, row));
        this.over = this.one ? -1 : row;
        if (from) this.to = foot(event.point, ...from.ends);
      },
      down(event) {
        this.move(event);
        const { one, over } = this;
        const ends = one?.piece !== undefined ? pieceOf(one) : over >= 0 ? finder.ends(over) : null;
        if (ends) Object.assign(this, { from: { one, row: over, ends, point: foot(event.point, ...ends) }, to: null });
        else if (one) editor.change("erased", (edits) => deleteDecided(edits, one));
      },
      up() {
        const { from, to } = this;
        Object.assign(this, { from: null, to: null, over: -1 });
        if (!from) return;
        const { one } = from;
        const between = to && away(from.point, to) * sheet.view.scale > 8 ? [from.point, to].map(rounded) : null;
        if (one) editor.change(between ? "a piece of wall erased" : "erased", (edits) => deleteDecided(edits, between ? { ...one, between } : one));
        else if (between) {
          editor.change("a piece of wall erased", (edits) => (edits.remove ??= []).push({ between }));
        } else if (drawn(from.row)) editor.change("erased", (edits) => (edits.remove ??= []).push({ between: finder.ends(from.row).map(rounded) }));
        else editor.change("erased", (edits) => (edits.class ??= []).push({ select: { near: inUnits(middle(from.row)) }, as: "nothing" }));
      },
      draw(context) {
        if (this.over >= 0) sheet.line(context, finder.ends(this.over), { colour: "#e03131", width: 5 });
        if (this.from && this.to) sheet.line(context, [this.from.point, this.to], { colour: "#e03131", width: 6 });
        if (this.one) {
          mark(context, this.one, "#e03131");
          sheet.dot(context, editor.pointer, "#e03131", 6, "×");
        }
      },
    },
    robot: {
      cursor: "none",
      hint: "the beams follow the mouse; press and drag to place the robot with its heading",
      heading: 0,
      start() {
        this.heading = sheet.plan.edits.robot?.start?.[2] ?? 0;
      },
      leave() {
        editor.endScan();
      },
      down(event) {
        this.from = event.altKey ? event.point : finder.onGrid(event.point, 0.1);
      },
      move(event) {
        if (this.from && away(this.from, event.point) * sheet.view.scale > 6) {
          this.heading = Math.round((Math.atan2(event.point[1] - this.from[1], event.point[0] - this.from[0]) * 180) / Math.PI);
        }
        editor.scan([...(this.from ?? event.point), this.heading]);
      },
      up() {
        const pose = [...rounded(this.from), this.heading];
        this.from = null;
        editor.change("the robot placed", (edits) => ((edits.robot ??= {}).start = pose));
      },
      draw() {},
    },
    goal: {
      cursor: "crosshair",
      hint: "click where the robot is to drive; the way there is planned",
      down(event) {
        editor.change("a goal set", (edits) => {
          edits.robot ??= {};
          (edits.robot.route ??= []).push(rounded(event.point));
        });
        this.now = null;
      },
      move(event) {
        this.now = event.point;
      },
      draw(context) {
        if (this.now) sheet.dot(context, this.now, "#2b6cb0", 9, String((sheet.plan.edits.robot?.route?.length ?? 0) + 1));
      },
    },
    keep: {
      cursor: "crosshair",
      hint: "an area that routes avoid: drag from corner to corner, or click its corners; Enter ends",
      ...polyline((edits, points) => (edits.keep_out ??= []).push({ points }), 3, true, "an area to keep out of", {}),
    },
    obstacle: {
      cursor: "crosshair",
      hint: "click where it stands and press Enter, or click the points of its way, then Enter; it goes there and back",
      ...polyline((edits, points) => (edits.obstacle ??= []).push(points.length > 1 ? { route: points, ...editor.obstacle } : { route: [points[0], points[0]], radius: editor.obstacle.radius }), 1, false, "an obstacle", { alone: "Enter: it stands here" }),
    },
  };
}
