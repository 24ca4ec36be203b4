// The tools: what clicks, drags and keys decide. A tool changes a copy of the decisions, which the editor keeps.

import { COLOURS } from "./sheet.js";

const REACH = 9; // Distance within which something is pointed at [pixels].
const away = ([x1, y1], [x2, y2]) => Math.hypot(x2 - x1, y2 - y1);
const rounded = (point) => point.map((each) => Math.round(1e4 * each) / 1e4);
const metres = (length) => `${length.toFixed(2)} m`;

// The point of a line that is nearest to another one.
function foot([x, y], [x1, y1], [x2, y2]) {
  const [dx, dy] = [x2 - x1, y2 - y1];
  const share = Math.min(1, Math.max(0, ((x - x1) * dx + (y - y1) * dy) / (dx * dx + dy * dy || 1)));
  return [x1 + share * dx, y1 + share * dy];
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
    const { strokes, kinds, ox, oy } = this.sheet.plan;
    const [x, y] = [point[0] - ox, point[1] - oy];
    let [best, least] = [-1, REACH / this.sheet.view.scale];
    for (let row = 0; row < kinds.length; row += 1) {
      const [x1, y1, x2, y2] = [strokes[4 * row], strokes[4 * row + 1], strokes[4 * row + 2], strokes[4 * row + 3]];
      if (Math.min(x1, x2) - least > x || Math.max(x1, x2) + least < x || Math.min(y1, y2) - least > y || Math.max(y1, y2) + least < y) continue;
      const off = away([x, y], foot([x, y], [x1, y1], [x2, y2]));
      if (off < least && fits(row)) [best, least] = [row, off];
    }
    return best;
  }

  // Where a point is drawn to: ends, lines, and right angles to a point before it.
  snap(point, last, before) {
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
        if (off < least) [best, least] = [[last[0] + along * way[0], last[1] + along * way[1]], off];
      }
    }
    const row = this.stroke(point);
    // A right angle ends at the line that is pointed at.
    const met = best && row >= 0 && crossing([last, best], this.ends(row));
    if (met && away(met, point) < 2 * reach) return { point: met, to: "line" };
    if (best) return { point: best, to: "angle" };
    return row >= 0 ? { point: foot(point, ...this.ends(row)), to: "line" } : { point, to: "" };
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

  // What was decided at a point: its table, its number, and the number of its point.
  function decided(point) {
    const reach = (REACH + 3) / sheet.view.scale;
    const { edits } = sheet.plan;
    const found = [];
    const near = (table, number, points) => points.forEach((each, place) => found.push({ table, number, place, off: away(point, each) }));
    if (edits.robot?.start) near("robot.start", 0, [edits.robot.start.slice(0, 2)]);
    near("robot.route", 0, edits.robot?.route ?? []);
    (edits.wall ?? []).forEach(({ points }, number) => near("wall", number, points));
    (edits.doorway ?? []).forEach(({ at }, number) => near("doorway", number, [at]));
    (edits.keep_out ?? []).forEach(({ points }, number) => near("keep_out", number, points));
    (edits.obstacle ?? []).forEach(({ route }, number) => near("obstacle", number, route));
    const best = found.sort((a, b) => a.off - b.off)[0];
    if (best && best.off < reach) return best;
    for (const [number, { points, closed }] of (edits.wall ?? []).entries()) {
      const ring = closed ? [...points, points[0]] : points;
      for (let place = 1; place < ring.length; place += 1) {
        if (away(point, foot(point, ring[place - 1], ring[place])) < reach) return { table: "wall", number, piece: place - 1 };
      }
    }
    return null;
  }

  const pointsOf = (edits, { table, number }) => {
    if (table === "robot.route") return edits.robot.route;
    return edits[table][number][table === "obstacle" ? "route" : "points"];
  };

  function moveDecided(edits, one, to) {
    if (one.table === "robot.start") edits.robot.start = [...rounded(to), edits.robot.start[2]];
    else if (one.table === "doorway") edits.doorway[one.number].at = rounded(to);
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

  // Tools that take points until Enter, or until a line comes back to its beginning.
  const polyline = (keep, least, closes, word) => ({
    points: [],
    typed: "",
    start() {
      this.points = [];
      this.typed = "";
    },
    at(event) {
      const last = this.points.at(-1);
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
      this.typed = "";
      if (to === "close" || event.detail > 1) return this.finish(to === "close");
      this.points.push(point);
      return true;
    },
    key({ key }) {
      if (key === "Enter" && this.typed && this.now) {
        this.points.push(this.at(this.event).point);
        this.typed = "";
      } else if (key === "Enter") this.finish(false);
      else if (key === "Backspace") this.typed ? (this.typed = this.typed.slice(0, -1)) : this.points.pop();
      else if (this.points.length && /^[\d.,]$/.test(key)) this.typed += key.replace(",", ".");
      else return false;
      if (this.event) this.now = this.at(this.event);
      return true;
    },
    finish(closed) {
      const points = this.points.filter((point, place) => !place || away(point, this.points[place - 1]) > 0.002).map(rounded);
      this.start();
      if (points.length >= least) editor.change(`${word} drawn`, (edits) => keep(edits, points, closed));
    },
    draw(context) {
      const { points, now } = this;
      if (!now) return;
      const line = [...points, now.point];
      sheet.line(context, line, { colour: "#f07c14", width: 2.5, closed: closes && points.length > 1 });
      sheet.dot(context, now.point, now.to ? "#37a350" : "#f07c14", 4.5);
      if (points.length) sheet.label(context, now.point, this.typed ? `${this.typed}▏ m` : metres(away(points.at(-1), now.point)), now.to === "angle" ? "#2b8a3e" : "#1c2534");
    },
  });

  const boxed = (from, to) => [from, [to[0], from[1]], to, [from[0], to[1]]];

  return {
    select: {
      cursor: "default",
      hint: "click what was understood wrongly, or drag around it; then say what it is",
      down(event) {
        const one = decided(event.point);
        if (one && one.place !== undefined) return (this.drag = { one, edits: structuredClone(sheet.plan.edits) });
        if (one) return editor.pick({ one });
        const row = finder.stroke(event.point);
        if (row >= 0) {
          const end = finder.ends(row).find((each) => away(each, event.point) < REACH / sheet.view.scale);
          const picked = event.shiftKey && editor.picked?.rows ? [...editor.picked.rows, row] : [row];
          editor.pick({ rows: picked });
          const grabs = end && stands(row) && editor.wasPicked === row;
          editor.wasPicked = row;
          if (grabs) return (this.drag = { end });
        }
        this.drag = { around: [event.point], lasso: event.altKey, row };
      },
      move(event) {
        const { drag } = this;
        this.over = drag ? -1 : finder.stroke(event.point);
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
          editor.pick({ inside: area.map(inUnits), area });
        } else if (drag.around) drag.row < 0 && editor.pick(null);
        else if (drag.one && !drag.moved) editor.pick({ one: drag.one });
        else if (drag.one) editor.change("moved", (edits) => moveDecided(edits, drag.one, drag.to));
        else if (drag.to) editor.change("an end moved", (edits) => (edits.move ??= []).push({ end: drag.end, to: rounded(drag.to) }));
      },
      draw(context) {
        const { drag } = this;
        if (editor.picked?.rows) sheet.lines(context, editor.rowsLike().map((row) => finder.ends(row)), "#f5a623", 5);
        if (editor.picked?.area) sheet.line(context, editor.picked.area, { colour: "#f5a623", width: 2, closed: true, fill: "rgba(245, 166, 35, 0.12)" });
        if (editor.picked?.one) {
          const { one } = editor.picked;
          if (one.table === "wall" && sheet.plan.edits.wall?.[one.number]) {
            const { points, closed } = sheet.plan.edits.wall[one.number];
            sheet.line(context, points, { colour: "#f5a623", width: 5, closed });
            for (const point of points) sheet.dot(context, point, "#f5a623", 4.5);
          }
        }
        if (this.over >= 0 && !drag) sheet.line(context, finder.ends(this.over), { colour: "rgba(245, 166, 35, 0.55)", width: 5 });
        if (drag?.around) sheet.line(context, drag.lasso ? drag.around : boxed(drag.around[0], drag.around.at(-1)), { colour: "#f5a623", width: 1.5, dash: [4, 4], closed: true });
        if (drag?.to) sheet.dot(context, drag.to, "#f5a623", 6);
      },
      key({ key }) {
        const classes = ["wall", "furniture", "glass", "mirror", "door", "nothing"];
        if (classes[key - 1] && editor.picked) editor.classify(classes[key - 1]);
        else if (["Delete", "Backspace"].includes(key) && editor.picked?.one) editor.change("deleted", (edits) => deleteDecided(edits, editor.picked.one));
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
        this.now = event.altKey ? event.point : finder.snap(event.point, this.ends[0]).point;
      },
      down(event) {
        this.move(event);
        if (this.ends.length > 1) this.ends = [];
        this.ends.push(this.now);
        if (this.ends.length === 2) editor.ask({ between: this.ends.map(inUnits), why: "the length of this", metres: null });
      },
      draw(context) {
        const line = this.ends.length === 1 && this.now ? [this.ends[0], this.now] : this.ends;
        if (line.length > 1) sheet.line(context, line, { colour: "#37a350", width: 3 });
        for (const end of [...this.ends, ...(this.now ? [this.now] : [])]) sheet.dot(context, end, "#37a350", 4.5);
        if (this.ends.length === 1 && this.now) sheet.label(context, this.now, sheet.plan.scaled ? metres(away(this.ends[0], this.now)) : "? m");
      },
    },
    wall: {
      cursor: "crosshair",
      hint: "click the corners; digits set a length; Enter ends, the first corner closes",
      ...polyline((edits, points, closed) => (edits.wall ??= []).push({ points, ...(closed && { closed: true }), ...editor.style }), 2, false, "a wall"),
    },
    room: {
      cursor: "crosshair",
      hint: "drag from corner to corner",
      down(event) {
        this.from = finder.snap(event.point).point;
        this.to = this.from;
      },
      move(event) {
        this.now = event.altKey ? event.point : finder.snap(event.point).point;
        if (this.from) this.to = this.now;
      },
      up() {
        const { from, to } = this;
        this.from = null;
        if (from && Math.min(Math.abs(to[0] - from[0]), Math.abs(to[1] - from[1])) > 0.05) {
          editor.change("a room drawn", (edits) => (edits.wall ??= []).push({ points: boxed(from, to).map(rounded), closed: true, ...editor.style }));
        }
      },
      draw(context) {
        if (this.from) {
          sheet.line(context, boxed(this.from, this.to), { colour: "#f07c14", width: 2.5, closed: true });
          sheet.label(context, this.to, `${Math.abs(this.to[0] - this.from[0]).toFixed(2)} × ${metres(Math.abs(this.to[1] - this.from[1]))}`);
        }
        if (this.now) sheet.dot(context, this.now, "#f07c14", 4.5);
      },
    },
    door: {
      cursor: "crosshair",
      hint: "click a wall; the width is that of the field on the right",
      move(event) {
        const row = finder.stroke(event.point, stands);
        this.now = null;
        if (row < 0) return;
        const [one, two] = finder.ends(row);
        const long = away(one, two) || 1;
        this.now = { at: foot(event.point, one, two), way: [(two[0] - one[0]) / long, (two[1] - one[1]) / long] };
      },
      down(event) {
        this.move(event);
        if (this.now) editor.change("a doorway cut", (edits) => (edits.doorway ??= []).push({ at: rounded(this.now.at), width: editor.doorWidth }));
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
      move(event) {
        const { from } = this;
        this.one = from ? null : decided(event.point);
        this.over = this.one || from ? -1 : finder.stroke(event.point, stands);
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
        if (this.one) sheet.dot(context, editor.pointer, "#e03131", 6, "×");
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
        this.from = event.point;
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
      hint: "click the corners of an area that routes avoid; Enter ends",
      ...polyline((edits, points) => (edits.keep_out ??= []).push({ points }), 3, true, "an area to keep out of"),
    },
    obstacle: {
      cursor: "crosshair",
      hint: "click the way of something that moves there and back; Enter ends",
      ...polyline((edits, points) => (edits.obstacle ??= []).push({ route: points, radius: 0.3, speed: 0.5 }), 2, false, "an obstacle"),
    },
  };
}
