// The editor: asks the server what follows from each decision, and shows it. What was decided can be undone without end.

import { COLOURS, LOW, Sheet, roomsPicture } from "./sheet.js";
import { Finder, makeTools, overlap } from "./tools.js";

const TYPES = { f4: Float32Array, u1: Uint8Array, u2: Uint16Array };
const TOOL_KEYS = {
  KeyV: "select", KeyS: "scale", KeyW: "wall", KeyB: "room", KeyX: "box", KeyD: "door",
  KeyE: "erase", KeyR: "robot", KeyG: "goal", KeyK: "keep", KeyO: "obstacle",
};
const part = (name) => document.querySelector(`.lrf3d-${name}`);
const sheet = new Sheet(part("sheet"), part("top"));

const editor = {
  sheet,
  finder: new Finder(sheet),
  picked: null, // Strokes, an area, or something that was decided.
  like: { layers: false, rules: false, colours: false },
  doorWidth: 0.9,
  style: {}, // Height and material of walls to be drawn.
  boxHeight: 0.8,
  obstacle: { radius: 0.3, speed: 0.5 }, // Of those to be placed.
  past: [],
  future: [],
  pointer: [0, 0],
  reads: false,
  pending: 0, // Changes that the server has not answered yet.

  // Change the decisions; what goes on with the change before is undone with it.
  change(what, make, goesOn = false) {
    if (this.reads) return note("this page only reads: the file is open in another editor");
    const before = sheet.plan.edits;
    const edits = structuredClone(before);
    make(edits);
    if (!goesOn) this.past.push(before);
    this.future = [];
    this.keep(edits, what);
  },

  keep(edits, what) {
    const { version, source, digest, ...decisions } = edits;
    // Hints have been read; some choices stay.
    if (!part("notice").dataset.stays) part("notice").hidden = true;
    if (JSON.stringify(edits.scale) !== JSON.stringify(sheet.plan.edits.scale)) {
      this.refit = true;
      sheet.held = sheet.plan.edits;
    }
    sheet.plan.edits = edits;
    Object.assign(sheet, { route: null, doubts: [] });
    for (const each of Object.values(tools)) Object.assign(each, { over: -1, one: null });
    part("saved").textContent = `${what} …`;
    roomsAreOld(true);
    send({ do: "keep", edits: decisions });
    this.pending += 1;
    this.what = what;
    buttons();
  },

  undo(from = this.past, to = this.future, word = "undone") {
    if (!from.length || this.reads) return;
    to.push(sheet.plan.edits);
    this.pick(null);
    this.keep(from.pop(), word);
  },

  redo() {
    this.undo(this.future, this.past, "done again");
  },

  // Ask for the exact beams, one question at a time.
  scan(pose) {
    sheet.robot = pose;
    this.wish = [pose[0], pose[1], (pose[2] * Math.PI) / 180];
    this.askScan();
    sheet.stale();
  },

  askScan() {
    if (!this.wish || this.scanning) return;
    this.scanning = performance.now();
    send({ do: "scan", pose: this.wish });
    this.wish = null;
  },

  endScan() {
    Object.assign(sheet, { robot: null, beams: null });
    this.wish = null;
    sheet.stale();
  },

  pick(what) {
    this.picked = what;
    this.like = { layers: false, rules: false, colours: false };
    showPicked();
    sheet.stale();
  },

  // The strokes that are meant: those that were clicked, or all like them.
  rowsLike() {
    const { rows } = this.picked;
    const keys = Object.keys(this.like).filter((key) => this.like[key]);
    if (!keys.length) return rows;
    const { plan } = sheet;
    const all = [];
    for (let row = 0; row < plan.kinds.length; row += 1) {
      if (keys.every((key) => plan[`${key}Of`][row] === plan[`${key}Of`][rows[0]])) all.push(row);
    }
    return all;
  },

  classify(as) {
    const { plan } = sheet;
    const { rows, inside } = this.picked;
    if (inside && as === "furniture" && plan.picture) return this.fill();
    const keys = Object.keys(this.like).filter((key) => this.like[key]);
    const named = { layers: "layer", rules: "rule", colours: "colour" };
    let selects;
    if (inside) selects = [{ inside }];
    else if (keys.length) selects = [Object.fromEntries(keys.map((key) => [named[key], escaped(plan[key][plan[`${key}Of`][rows[0]]])]))];
    else {
      selects = rows.map((row) => {
        const [one, two] = this.finder.ends(row);
        return { near: [(one[0] + two[0]) / 2 / plan.unit, (one[1] + two[1]) / 2 / plan.unit].map((each) => Math.round(1e4 * each) / 1e4) };
      });
    }
    this.change(takenFor(as), (edits) => (edits.class = reclassed(edits.class, selects, as)));
    this.pick(null);
  },

  // A solid box instead of what is drawn in an area: around it, if that is a rectangle. It replaces one that is there already.
  fill() {
    const { area, exact } = this.picked;
    const points = ((!exact && sheet.inkIn(area)) || area).map(rounded);
    this.change("a box of furniture", (edits) => {
      const others = (edits.wall ?? []).filter((each) => !(each.closed && each.height < LOW && overlap(each.points, points) > 0.5));
      edits.wall = [...others, { points, closed: true, height: this.boxHeight }];
    });
    this.pick(null);
  },

  // The wall that is picked gets a material. One side of several gets a wall of its own on top, so that the whole stays one.
  madeOf(material) {
    const { number, piece } = this.picked.one;
    const wall = sheet.plan.edits.wall[number];
    const { points, height } = wall;
    if (points.length === 2 || piece === undefined) return this.change("changed", (edits) => Object.assign(edits.wall[number], { material }));
    const ends = [points[piece], points[(piece + 1) % points.length]];
    this.change("changed", (edits) => edits.wall.splice(number + 1, 0, { points: ends, ...(height && { height }), material }));
    this.pick({ one: { table: "wall", number: number + 1, piece: 0 } });
  },

  // The wall that is picked becomes something else, by the keys that say what strokes are.
  make(kind) {
    const { one } = this.picked;
    if (kind === "nothing") {
      this.change("deleted", (edits) => tools.select.drop(edits, one));
      return this.pick(null);
    }
    if (kind === "door") return note("D cuts a doorway into a wall");
    if (kind === "glass" || kind === "mirror") return this.madeOf(kind);
    this.change(takenFor(kind), (edits) => {
      const { material, height, ...rest } = edits.wall[one.number];
      edits.wall[one.number] = kind === "furniture" ? { ...rest, height: this.boxHeight } : { ...rest, ...(height >= LOW && { height }) };
    });
  },

  classifyBy(select, as) {
    this.change(takenFor(as), (edits) => (edits.class = reclassed(edits.class, [select], as)));
  },

  // Ask whether a length is right: places in units of the drawing.
  ask(question) {
    this.question = question;
    const card = part("ask");
    card.hidden = false;
    const input = card.querySelector("input");
    const now = sheet.plan.scaled && !question.metres ? ` Now it is ${(apart(question.between) * sheet.plan.unit).toFixed(2)} m.` : "";
    card.querySelector("p").textContent = question.metres ? `Is ${question.why} this long?` : `How long is this?${now}`;
    input.value = question.metres ?? "";
    card.querySelector(".lrf3d-yes").textContent = question.metres ? "Yes" : "Set";
    card.querySelector("[data-do=other]").hidden = !question.metres;
    part("notice").hidden = true;
    beside(card, question.between);
    // What is only offered takes no keys.
    if (!question.metres) input.focus();
    sheet.stale();
  },

  answer(metres, sure = false) {
    const { between, metres: offered, doubted } = this.question;
    const says = (text) => (part("ask").querySelector("p").textContent = text);
    if (!(metres > 0 && metres < Infinity)) return says("a length in metres, such as 0.9");
    const factor = metres / apart(between) / sheet.plan.unit;
    const door = doorOf(offered, factor, metres);
    // A length that is given twice is meant.
    if (!sure && metres !== doubted && !usual(door)) {
      const likely = [0.01, 0.001, 100, 1000].find((each) => usual(each * door));
      this.question.doubted = metres;
      says(`${offered ? "A door" : "Doors"} of ${Number(door.toPrecision(3))} m?`);
      return Object.assign(part("ask").querySelector("input"), { value: Number(((likely ?? 1) * metres).toPrecision(4)) }).select();
    }
    part("ask").hidden = true;
    part("top").focus();
    this.question = null;
    this.change("the scale set", (edits) => {
      rescale(edits, factor);
      edits.scale = { between, metres };
    });
    choose("select");
  },
};
editor.described = described;
editor.note = (text) => note(text);
const tools = makeTools(editor);
let tool = tools.select;
let socket;

// A name as a pattern that fits it alone.
const escaped = (name) => name.replace(/[[*?]/g, "[$&]");
const send = (values) => socket.send(JSON.stringify(values));
const note = (text) => (part("note").textContent = text);
// Rooms are counted anew after each decision; until then the count has dots.
function roomsAreOld(old) {
  const count = part("rooms").textContent.replace(" …", "");
  part("rooms").textContent = old && count ? `${count} …` : count;
}
const rounded = (point) => point.map((each) => Math.round(1e4 * each) / 1e4);
// Doors are about as wide as this [m].
const usual = (width) => width >= 0.5 && width <= 2;
const apart = ([[x1, y1], [x2, y2]]) => Math.hypot(x2 - x1, y2 - y1);
// The width of the door that is asked about, or of most doors of the plan, if it grows by a factor [m]; without any, that of a usual one.
function doorOf(suggested, factor, metres) {
  if (suggested) return metres;
  const widths = [...sheet.plan.doors, ...sheet.plan.gaps].map(apart).sort((a, b) => a - b);
  return widths.length ? factor * widths[widths.length >> 1] : 0.9;
}

// The classes with new ones of some selectors, instead of those that were there.
function reclassed(before = [], selects, as) {
  const names = selects.map((select) => JSON.stringify(select));
  return [...before.filter(({ select }) => !names.includes(JSON.stringify(select))), ...selects.map((select) => ({ select, as }))];
}

const KEYED = ["wall", "furniture", "glass", "mirror", "door", "nothing"]; // The classes by their keys, from 1.
const word = (kind) => (kind === "nothing" ? "left out" : kind);
const takenFor = (as) => (as === "nothing" ? "left out" : `taken for ${as}`);
const RULES = { "dark part": "thin or loose marks" };

// Place a card where it hides no end of a line, in units of the drawing.
function beside(card, line) {
  const [one, two] = line.map((point) => sheet.toScreen(point.map((each) => each * sheet.plan.unit)));
  const low = Math.max(one[1], two[1]) + 24;
  const top = low + card.offsetHeight < sheet.height ? low : Math.max(8, Math.min(one[1], two[1]) - card.offsetHeight - 40);
  const left = Math.min(Math.max(8, (one[0] + two[0] - card.offsetWidth) / 2), sheet.width - card.offsetWidth - 8);
  Object.assign(card.style, { left: `${left}px`, top: `${top}px` });
}

// What cannot be reached, and why, by the names on the plan; and what else was noted.
function tell() {
  const { rooms, doubts, plan } = sheet;
  const missed = (rooms?.rooms ?? []).map(({ why }, place) => why && `R${place + 1} is not reached: ${why}`);
  const goals = doubts.map((why, place) => why && `goal ${place + 1}: ${why}`);
  const lost = plan.lost.length ? [`not found any more: ${plan.lost.join(", ")}`] : [];
  note([...lost, ...missed, ...goals, ...(plan.notes ?? []), plan.said].filter(Boolean).join("; "));
}

// What was decided in metres stays where it is on a drawing that gets another scale.
function rescale(edits, factor) {
  const grown = (value) => (Array.isArray(value) ? value.map(grown) : factor * value);
  for (const each of edits.wall ?? []) each.points = grown(each.points);
  for (const each of edits.doorway ?? []) each.at = grown(each.at);
  for (const each of edits.remove ?? []) each.between = grown(each.between);
  for (const each of edits.move ?? []) Object.assign(each, { end: grown(each.end), to: grown(each.to) });
  for (const each of edits.keep_out ?? []) each.points = grown(each.points);
  for (const each of edits.obstacle ?? []) each.route = grown(each.route);
  const { robot } = edits;
  if (robot?.start) robot.start = [...grown(robot.start.slice(0, 2)), robot.start[2]];
  if (robot?.route) robot.route = grown(robot.route);
}

// Answers of the server ----------------------------------------------------------------------------

function unpacked(data) {
  const length = new DataView(data).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  const arrays = {};
  for (const [name, [type, first, size]] of Object.entries(header.arrays)) arrays[name] = new TYPES[type](data, 4 + length + first, size);
  return [header, arrays];
}

// Steps outlive a reload: they are kept for this tab, with the decisions at which they lead.
const MOST_STEPS = 300;

function remember({ name, edits }, first) {
  const key = `lrf3d edit ${name}`;
  const now = JSON.stringify({ ...edits, digest: "" });
  try {
    const kept = first && JSON.parse(sessionStorage.getItem(key));
    if (kept?.now === now) Object.assign(editor, { past: kept.past, future: kept.future });
    const { past, future } = editor;
    sessionStorage.setItem(key, JSON.stringify({ now, past: past.slice(-MOST_STEPS), future: future.slice(-MOST_STEPS) }));
  } catch {
    // Without storage they live as long as the page.
  }
}

const TAKE = {
  plan(header, { layers, rules, colours, ...arrays }) {
    const first = !sheet.plan;
    const unit = sheet.plan?.unit;
    if (editor.pending) editor.pending -= 1;
    // What was decided meanwhile is newer than this answer.
    if (editor.pending) header.edits = sheet.plan.edits;
    // Rows of another drawing mean other strokes.
    if (editor.picked?.rows && sheet.plan?.kinds.length !== arrays.kinds.length) editor.picked = null;
    Object.assign(sheet, { route: null, doubts: [], held: null });
    sheet.take(header, { ...arrays, layersOf: layers, rulesOf: rules, coloursOf: colours });
    if (first || editor.refit || unit !== header.unit) sheet.fit();
    remember(header, first);
    const [x1, y1, x2, y2] = header.bounds;
    const size = `${(x2 - x1).toFixed(1)} × ${(y2 - y1).toFixed(1)} m`;
    if (editor.refit) sheet.rooms = null;
    const asks = first || (editor.refit && !header.edits.scale && !header.scaled);
    if (editor.refit && header.edits.scale) {
      const { text, offers } = header.check;
      notice(`At this scale: ${size}${text && `, with ${text}`}.${offers.length ? " If that is wrong:" : ""}`, offers.map(([words, factor]) => [words, () => scaled(header, factor)]));
    } else if (editor.refit) part("notice").hidden = true;
    editor.refit = false;
    part("title").textContent = `lrf3d edit ${header.name}`;
    document.title = `${header.name} — lrf3d edit`;
    part("size").textContent = !arrays.kinds.length ? "" : `${size}${header.scaled ? "" : ", not to scale yet"}`;
    part("saved").textContent = editor.pending ? `${editor.what} …` : editor.what ? `${editor.what}, saved` : header.edits.digest || header.edits.wall ? "changes saved" : "";
    part("old").textContent = header.old;
    part("map-only").hidden = !header.rosMap;
    const grey = header.edits.reading?.threshold ?? (header.grey && Math.round(header.grey));
    part("picture").hidden = !grey;
    if (grey && !part("threshold").matches(":active")) part("threshold").value = part("grey").textContent = grey;
    tell();
    showOver();
    if (first && header.sheet) loadPicture();
    showLists();
    showPicked();
    if (asks) firstQuestion(header, arrays.kinds.length);
    part("failure")?.remove();
    buttons();
  },
  scan(header, { beams }) {
    const took = performance.now() - editor.scanning;
    editor.scanning = 0;
    if (sheet.robot) sheet.beams = beams;
    part("over").textContent = `${header.hits} of ${beams.length / 4} beams hit, ${took.toFixed(0)} ms`;
    sheet.stale();
    editor.askScan();
  },
  rooms(header, { cells }) {
    // What was decided meanwhile may change it.
    if (editor.pending) return;
    sheet.rooms = roomsPicture(header, cells);
    sheet.doubts = header.goals;
    sheet.plan.radius = header.radius;
    const { length } = header.rooms;
    const missed = header.rooms.filter(({ why }) => why).length;
    part("rooms").textContent = `${length} ${length === 1 ? "room" : "rooms"}, ${length - missed} reached`;
    part("rooms").classList.toggle("lrf3d-some", missed > 0);
    tell();
    sheet.stale(true);
  },
  route(header) {
    if (editor.pending) return;
    sheet.route = header.route;
    sheet.plan.radius = header.radius;
    sheet.plan.notes = header.notes;
    tell();
    sheet.stale();
  },
  none(header) {
    if (editor.pending) return;
    if (header.what === "rooms") {
      sheet.rooms = null;
      part("rooms").textContent = "";
    } else sheet.route = null;
    if (sheet.plan.kinds.length && !sheet.doubts.some(Boolean)) sheet.plan.notes = [header.text];
    tell();
    sheet.stale(true);
  },
  role(header) {
    editor.reads = header.reads;
    if (header.reads) notice("This file is open in another editor: this page only shows it.");
  },
  error(header) {
    editor.scanning = 0;
    for (const what of ["world", "map"]) document.querySelector(`[data-do=${what}]`).disabled = false;
    if (editor.pending) {
      editor.pending -= 1;
      sheet.plan.edits = editor.past.pop() ?? sheet.plan.edits;
      part("saved").textContent = "not taken";
      roomsAreOld(false);
    }
    sheet.held = null;
    editor.refit = false;
    editor.film?.close();
    editor.film = null;
    notice(header.text);
    sheet.stale();
  },
  said(header) {
    for (const what of ["world", "map"]) document.querySelector(`[data-do=${what}]`).disabled = false;
    if (header.text.endsWith(".toml is written")) part("old").textContent = "";
    notice(header.text);
  },
  changed: () => notice("The file has changed.", [["Read it again", () => send({ do: "read" })]]),
  film(header) {
    const open = () => window.open(header.address, "lrf3d-film");
    if (editor.film && !editor.film.closed) {
      part("notice").hidden = true;
      editor.film.location = header.address;
    } else notice("The film is ready.", [["Open it", open]]);
    editor.film = null;
  },
};

function loadPicture() {
  const picture = new Image();
  picture.onload = () => {
    sheet.picture = picture;
    sheet.stale(true);
  };
  picture.src = "/lrf3d/source.png";
}

function firstQuestion(header, strokes) {
  if (header.edits.scale || editor.reads) return;
  if (!strokes) {
    choose("room");
    return notice("An empty sheet in metres: drag a room from corner to corner, or press W and click the corners of walls.");
  }
  const [suggested] = header.suggestions;
  // Scales that would fit a drawing of a doubtful size.
  const scales = Object.entries(header.scales);
  if (suggested && !scales.length) editor.ask(suggested);
  else if (!header.scaled || scales.length) {
    choose("scale");
    notice("How large is it? Click the two ends of something whose length you know, such as a door of 0.9 m.", scales.map(([words, factor]) => [words, () => scaled(header, factor)]));
  }
}

function scaled({ bounds, unit }, factor) {
  const [x1, y1, x2] = bounds;
  const across = x2 - x1 || 1;
  editor.question = { between: [[x1 / unit, y1 / unit], [(x1 + across) / unit, y1 / unit]] };
  editor.answer(factor * across, true);
}

// What is not about the decisions of now stays when these change.
function notice(text, choices = [], stays = choices.length > 0) {
  const card = part("notice");
  card.textContent = text;
  card.dataset.stays = stays ? "yes" : "";
  for (const [textContent, act] of choices) {
    const onclick = () => {
      card.hidden = true;
      act();
    };
    card.append(Object.assign(document.createElement("button"), { textContent, onclick }));
  }
  card.append(Object.assign(document.createElement("button"), { textContent: "×", ariaLabel: "close", onclick: () => (card.hidden = true) }));
  card.hidden = false;
}

// Lists and cards ----------------------------------------------------------------------------------

function showLists() {
  const { plan } = sheet;
  const count = (key) => {
    const held = new Map();
    for (let row = 0; row < plan.kinds.length; row += 1) {
      const name = plan[key][plan[`${key}Of`][row]];
      const own = held.get(name) ?? { count: 0, kinds: {}, row };
      own.count += 1;
      const kind = plan.classes[plan.kinds[row]];
      own.kinds[kind] = (own.kinds[kind] ?? 0) + 1;
      held.set(name, own);
    }
    return [...held].sort((a, b) => b[1].count - a[1].count);
  };
  fill(part("layers"), count("layers"), "layers", "layer");
  fill(part("rules"), count("rules").filter(([name]) => name && name !== "drawn"), "rules", "rule");
}

function fill(section, rows, key, selector) {
  section.hidden = !rows.some(([name]) => name);
  section.lastElementChild.replaceChildren(
    ...rows.filter(([name]) => name).map(([name, { count, kinds, row }]) => {
      const line = Object.assign(document.createElement("div"), { className: "lrf3d-row", title: name });
      const usual = Object.entries(kinds).sort((a, b) => b[1] - a[1])[0][0];
      const choice = document.createElement("select");
      choice.ariaLabel = `${name} is`;
      for (const kind of sheet.plan.classes) choice.append(new Option(word(kind), kind, false, kind === usual));
      choice.onchange = () => editor.classifyBy({ [selector]: escaped(name) }, choice.value);
      choice.onclick = (event) => event.stopPropagation();
      line.append(Object.assign(document.createElement("span"), { textContent: RULES[name] ?? name }), Object.assign(document.createElement("i"), { textContent: count }), choice);
      line.onclick = () => {
        choose("select");
        editor.pick({ rows: [row] });
        editor.like[key] = true;
        showPicked();
        sheet.stale();
      };
      return line;
    }),
  );
}

const field = (text, value, change, type = "text") => {
  const label = document.createElement("label");
  const input = Object.assign(document.createElement("input"), { type, value: value ?? "" });
  if (type === "checkbox") input.checked = value;
  input.onchange = () => change(type === "checkbox" ? input.checked : input.value);
  label.append(...(type === "checkbox" ? [input, text] : [text, input]));
  return label;
};

function materials(value, change) {
  const label = document.createElement("label");
  const choice = document.createElement("select");
  for (const each of ["plaster", "glass", "mirror", "brick", "metal", "dark cloth"]) choice.append(new Option(each === "dark cloth" ? "dark cloth, hardly seen" : each, each, false, each === (value ?? "plaster")));
  choice.onchange = () => change(choice.value === "plaster" ? undefined : choice.value);
  label.append("made of", choice);
  return label;
}

function button(textContent, onclick) {
  return Object.assign(document.createElement("button"), { textContent, onclick });
}

const paragraph = (textContent, kind = "p") => Object.assign(document.createElement(kind), { textContent });

// The panel of something that was decided: what it is, its values, and Delete.
function panelOf(one) {
  const { edits } = sheet.plan;
  const set = (values) => editor.change("changed", (now) => Object.assign(one.table === "robot.start" ? now.robot : now[one.table][one.number], values));
  const size = (text, key, usual) => field(text, edits[one.table][one.number][key] ?? usual, (value) => set({ [key]: Number(value) || usual }));
  const drop = () => {
    editor.change("deleted", (now) => tools.select.drop(now, one));
    editor.pick(null);
  };
  const parts = {
    wall: () => wallPanel(one, size),
    doorway: () => [size("width [m]", "width", 0.9)],
    obstacle: () => [size("radius [m]", "radius", 0.3), ...(!tools.select.stays(edits.obstacle[one.number]) ? [size("speed [m/s]", "speed", 0.5)] : [])],
    "robot.start": () => [field("heading [°]", edits.robot.start[2], (value) => set({ start: [...edits.robot.start.slice(0, 2), Number(value) || 0] }))],
  };
  const moved = one.table === "wall" ? "its ends can be dragged" : one.table === "keep_out" ? "its corners can be dragged" : "drag it to move it";
  return [paragraph(tools.select.named(one)), ...(parts[one.table]?.() ?? []), button("Delete", drop), paragraph(moved, "small")];
}

function wallPanel({ number, piece }, size) {
  const wall = sheet.plan.edits.wall[number];
  const several = wall.points.length > 2;
  const whole = () => editor.pick({ one: { table: "wall", number } });
  const found = [classButtons(KEYED.filter((kind) => kind !== "door"), (kind) => editor.make(kind)), materials(wall.material, (material) => editor.madeOf(material))];
  if (!several || piece === undefined) found.unshift(size("height [m]", "height", 2.5));
  if (piece !== undefined) {
    found.push(button("Add a corner here", () => editor.change("a corner added", (now) => now.wall[number].points.splice(piece + 1, 0, rounded(editor.picked.point)))));
    if (several) found.push(button("Select all of it", whole));
  }
  return found;
}

function showPicked() {
  const card = part("picked");
  const { picked } = editor;
  const { plan } = sheet;
  card.hidden = true;
  card.replaceChildren();
  if (tool === tools.door) {
    card.append(field("width [m]", editor.doorWidth, (value) => (editor.doorWidth = Number(value) || 0.9)));
  } else if (tool === tools.wall || tool === tools.room) {
    card.append(
      field("height [m]", editor.style.height ?? 2.5, (value) => (editor.style = { ...editor.style, height: Number(value) || 2.5 })),
      materials(editor.style.material, (material) => (editor.style = { ...editor.style, material })),
    );
  } else if (tool === tools.box) {
    card.append(field("height [m]", editor.boxHeight, (value) => (editor.boxHeight = Number(value) || 0.8)));
  } else if (tool === tools.robot && plan) {
    const radius = plan.edits.robot?.radius ?? plan.radius;
    card.append(field("radius [m]", radius && Number(radius.toFixed(3)), (value) => editor.change("the radius set", (edits) => {
      edits.robot = { ...edits.robot, radius: Number(value) };
      if (!(Number(value) > 0)) delete edits.robot.radius;
      if (!Object.keys(edits.robot).length) delete edits.robot;
    })));
    card.append(paragraph("empty: the widest that fits its doors", "small"));
  } else if (tool === tools.obstacle) {
    for (const [text, key] of [["radius [m]", "radius"], ["speed [m/s]", "speed"]]) card.append(field(text, editor.obstacle[key], (value) => (editor.obstacle[key] = Number(value) || editor.obstacle[key])));
  } else if (picked?.one && tools.select.exists(picked.one)) {
    card.append(...panelOf(picked.one));
  } else if (picked?.rows || picked?.inside) {
    card.append(Object.assign(document.createElement("p"), { textContent: picked.inside ? "all in this area" : described(picked.rows[0]) }));
    if (picked.rows) {
      for (const [key, word] of [["layers", "layer"], ["rules", "rule"], ["colours", "colour"]]) {
        const name = plan[key][plan[`${key}Of`][picked.rows[0]]];
        if (!name) continue;
        card.append(field(`all of this ${word}`, editor.like[key], (on) => {
          editor.like[key] = on;
          sheet.stale();
        }, "checkbox"));
      }
    }
    card.append(classButtons(plan.classes, (kind) => editor.classify(kind)));
  }
  if (picked?.inside && plan.picture) card.append(paragraph("furniture becomes a solid box", "small"));
  card.hidden = !card.children.length || editor.reads;
}

// A button for each class, in its colour and with its key.
function classButtons(kinds, act) {
  const classes = Object.assign(document.createElement("div"), { className: "lrf3d-classes" });
  for (const kind of kinds) {
    const swatch = document.createElement("b");
    swatch.style.background = COLOURS[kind];
    const hint = Object.assign(document.createElement("kbd"), { textContent: ` ${KEYED.indexOf(kind) + 1}` });
    const each = button("", () => act(kind));
    each.append(swatch, word(kind), hint);
    each.dataset.kind = kind;
    classes.append(each);
  }
  return classes;
}

function described(row) {
  const { plan } = sheet;
  const [one, two] = editor.finder.ends(row);
  const long = Math.hypot(two[0] - one[0], two[1] - one[1]).toFixed(2);
  const layer = plan.layers[plan.layersOf[row]];
  const rule = plan.rules[plan.rulesOf[row]];
  const kind = plan.classes[plan.kinds[row]];
  const why = rule ? RULES[rule] ?? rule : layer ? "by its layer" : "no rule takes it out";
  return `${long} m${layer ? ` on ${layer}` : ""}: ${word(kind)} (${why})`;
}

// Controls -----------------------------------------------------------------------------------------

// The pointer is not on the sheet: a tool shows nothing there.
const NOWHERE = { now: null, over: -1, one: null };
let rests = null; // Where the pointer rests on the sheet, when no button is pressed.

// What is under the pointer, in words: a plan that came just now may have changed it.
function showOver() {
  const looks = rests && tool.says;
  if (looks) tool.move({ ...rests, point: sheet.toPlan(rests.at) });
  part("over").textContent = (looks && tool.says()) || tool.hint;
}

function choose(name) {
  tool.leave?.();
  tool = tools[name];
  Object.assign(tool, NOWHERE);
  tool.start?.();
  if (name !== "select") editor.pick(null);
  for (const button of document.querySelectorAll("[data-tool]")) button.setAttribute("aria-pressed", button.dataset.tool === name);
  part("top").style.cursor = tool.cursor;
  part("over").textContent = tool.hint;
  showPicked();
  sheet.stale();
}

function buttons() {
  document.querySelector("[data-do=undo]").disabled = !editor.past.length;
  document.querySelector("[data-do=redo]").disabled = !editor.future.length;
}

// The tab is opened at once: one that comes later would be blocked.
function film() {
  const text = "The robot drives, and its film is made ready …";
  editor.film = window.open("", "lrf3d-film");
  if (editor.film) editor.film.document.body.textContent = text;
  notice(text);
  send({ do: "drive" });
}

// The button waits for the answer: a large map takes its time.
function save(what) {
  const pressed = document.querySelector(`[data-do=${what}]`);
  if (pressed.disabled) return;
  pressed.disabled = true;
  notice("saving …");
  send({ do: what });
}

const ACTIONS = {
  undo: () => editor.undo(),
  redo: () => editor.redo(),
  fit: () => sheet.fit(),
  list: () => (part("keys").hidden = !part("keys").hidden),
  world: () => save("world"),
  map: () => save("map"),
  drive() {
    const { scaled, kinds } = sheet.plan;
    if (!kinds.length) return notice("there is no wall yet; draw one");
    const missed = [!scaled && "the plan is not to scale yet", ...sheet.doubts.map((why, place) => why && `goal ${place + 1}: ${why}`)].filter(Boolean);
    if (missed.length) notice(`${missed.join("; ")}. Drive anyway?`, [["Drive", film]], false);
    else film();
  },
  other() {
    const { suggestions } = sheet.plan;
    const place = suggestions.indexOf(editor.question);
    if (suggestions[place + 1]) editor.ask(suggestions[place + 1]);
    else {
      part("ask").hidden = true;
      editor.question = null;
      choose("scale");
    }
  },
  later() {
    part("ask").hidden = true;
    editor.question = null;
    tools.scale.start();
    part("top").focus();
    sheet.stale();
  },
};

// A second click within this time is a double click [ms].
const TWICE = 400;

function placed(event) {
  const box = part("top").getBoundingClientRect();
  const at = [event.clientX - box.left, event.clientY - box.top];
  const { altKey, shiftKey } = event;
  editor.pointer = sheet.toPlan(at);
  return { at, point: editor.pointer, altKey, shiftKey };
}

function connect() {
  const top = part("top");
  let pan = null;
  let space = false;
  let pressed = false;
  let before = { time: -TWICE, at: [0, 0] };
  top.onpointerdown = (event) => {
    top.setPointerCapture(event.pointerId);
    top.focus();
    const where = placed(event);
    rests = null;
    if (space || event.button === 1 || event.button === 2) pan = where.at;
    else if (event.button === 0) {
      pressed = true;
      where.twice = event.timeStamp - before.time < TWICE && Math.hypot(where.at[0] - before.at[0], where.at[1] - before.at[1]) < 5;
      before = { time: event.timeStamp, at: where.at };
      tool.down?.(where);
    }
    sheet.stale();
  };
  top.onpointermove = (event) => {
    const where = placed(event);
    if (pan) {
      sheet.move([where.at[0] - pan[0], where.at[1] - pan[1]]);
      pan = where.at;
      return;
    }
    rests = pressed ? null : where;
    if (rests && tool.says) showOver();
    else tool.move?.(where);
    sheet.stale();
  };
  top.onpointerup = (event) => {
    if (pan) pan = null;
    else if (pressed) tool.up?.(placed(event));
    pressed = false;
    rests = placed(event);
    sheet.stale();
  };
  top.onpointerleave = () => {
    if (pressed || pan) return;
    rests = null;
    Object.assign(tool, NOWHERE);
    if (tool === tools.robot) editor.endScan();
    if (tool.says || tool === tools.robot) part("over").textContent = tool.hint;
    sheet.stale();
  };
  top.oncontextmenu = () => false;
  // A press would take the focus from what a tool asks.
  top.onmousedown = (event) => event.preventDefault();
  top.addEventListener("wheel", (event) => {
    event.preventDefault();
    sheet.zoom(placed(event).at, Math.exp(-0.0015 * event.deltaY));
  }, { passive: false });
  document.onkeyup = (event) => {
    if (event.code === "Space") space = false;
  };
  document.onkeydown = (event) => {
    const { code, key, ctrlKey, metaKey, shiftKey, target } = event;
    if ((ctrlKey || metaKey) && code === "KeyS") {
      event.preventDefault();
      if (target.matches("input")) target.blur();
      return ACTIONS.world();
    }
    if (key === "Escape" && editor.question) return ACTIONS.later();
    // A text has steps of its own to undo, a slider or a box has none.
    if (target.matches("input:not([type=range], [type=checkbox])")) return;
    if ((ctrlKey || metaKey) && ["KeyZ", "KeyY"].includes(code)) code === "KeyY" || shiftKey ? editor.redo() : editor.undo();
    else if (target.matches("input, select")) return;
    else if (ctrlKey || metaKey) return;
    else if (code === "Space" && !target.matches("button")) space = true;
    else if (key === "Escape") {
      tool.leave?.();
      tool.start?.();
      editor.pick(null);
      part("keys").hidden = true;
    } else if (tool.key?.(event)) sheet.stale();
    else if (TOOL_KEYS[code]) choose(TOOL_KEYS[code]);
    else if (code === "KeyF") sheet.fit();
    else if (code === "KeyH" || key === "?") ACTIONS.list();
    else return;
    event.preventDefault();
  };
  for (const button of document.querySelectorAll("[data-tool]")) button.onclick = () => choose(button.dataset.tool);
  for (const button of document.querySelectorAll("[data-do]")) button.onclick = ACTIONS[button.dataset.do];
  part("ask").onsubmit = (event) => {
    event.preventDefault();
    editor.answer(Number(part("ask").querySelector("input").value.replace(",", ".")));
  };
  part("threshold").oninput = (event) => {
    const threshold = Number(event.target.value);
    part("grey").textContent = threshold;
    clearTimeout(editor.slide);
    editor.slide = setTimeout(() => {
      editor.change("the threshold set", (edits) => ((edits.reading ??= {}).threshold = threshold), editor.sliding);
      editor.sliding = true;
    }, 150);
  };
  // The slider is released, after which its last change is still sent.
  part("threshold").onchange = () => setTimeout(() => (editor.sliding = false), 200);
  part("key").append(
    ...Object.entries(COLOURS).flatMap(([kind, colour]) => {
      const swatch = document.createElement("b");
      swatch.style.background = colour;
      return [swatch, Object.assign(document.createElement("span"), { textContent: word(kind) })];
    }),
    ...[["room", "a room that is reached, m² to its walls"], ["missed", "one that is not"], ["route", "the route"], ["robot", "the robot"], ["goal", "a goal"], ["obstacle", "an obstacle"]].flatMap(([name, textContent]) => [
      Object.assign(document.createElement("b"), { className: `lrf3d-is-${name}` }),
      Object.assign(document.createElement("span"), { textContent }),
    ]),
  );
  sheet.drawTool = (context) => {
    if (editor.question) {
      const ends = editor.question.between.map((point) => point.map((each) => each * sheet.plan.unit));
      sheet.line(context, ends, { colour: "#37a350", width: 6 });
      sheet.label(context, ends[1], editor.question.metres ? `${editor.question.metres} m?` : sheet.plan.scaled ? `${apart(ends).toFixed(2)} m` : "? m", "#2b8a3e");
    }
    tool.draw(context);
  };
}

connect();
choose("select");
sheet.resize();
socket = new WebSocket(`ws://${location.host}/lrf3d/edits`);
socket.binaryType = "arraybuffer";
socket.onmessage = ({ data }) => {
  const [header, arrays] = unpacked(data);
  TAKE[header.kind](header, arrays);
};
socket.onclose = () => notice("The server has ended; all that was decided is kept.", [], true);
window.editor = editor;
