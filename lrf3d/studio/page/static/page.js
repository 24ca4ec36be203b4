// The page: asks for moments of a run or has the robot drive, and shows what comes.

import { Scene } from "./scene.js";
import { source } from "./served.js";

const SPEEDS = [0.5, 1, 2, 4, 8, 16];
const STEP = 2; // Seconds that an arrow key skips.
const LONGEST = 0.5; // Seconds that a frame stands for at most: a hidden page draws none.
const TURN = 0.006; // Angle that the camera turns for each pixel of a drag [rad].
const STILL = 6; // How far a finger may move in a click [pixels].
const HOLD = 350; // How long it is held down to point out a heading, too [ms].
const ZOOM = 0.001; // How much farther off it goes for each pixel of a wheel's turn.

const setup = JSON.parse(document.querySelector("#setup").textContent);
const plays = setup.mode === "plays";
const part = (name) => document.querySelector(`.lrf3d-${name}`);
const viewButtons = [...document.querySelectorAll(`[data-view]${plays ? "" : ":not(.lrf3d-playing)"}`)];
const views = viewButtons.map((button) => button.dataset.view);
const held = { ahead: false, back: false, left: false, right: false }; // Which pads or their keys are down.
const STRAIGHT = { around: 0, over: 0, zoom: 1 }; // A camera that no hand has turned.
const fingers = new Map(); // Where each pointer is that drags, by its number.
let time = 0; // What is seen of a run, from its start [s].
let speed = setup.speed; // Seconds of the run in a second.
let playing = false;
let drive = 0; // The number of the drive by hand: another one starts again.
let goal = { goal: 0 }; // Where the robot is to go, on the ground; each has a number.
let press = null; // Where the ground was pressed, and when.
let asked = ""; // The last question.
let waiting = false; // For the answer to it.
let last = performance.now(); // When the last frame began [ms].
let view, scene, answers;

// What buttons and keys do.
const ACTIONS = {
  play: () => play(!playing),
  rewind: () => move(time - STEP),
  skip: () => move(time + STEP),
  begin: () => move(limits()[0]),
  end: () => move(limits()[1]),
  again: () => {
    drive += 1;
    goal = { goal: 0 };
  },
  next: () => choose(views[(views.indexOf(view) + 1) % views.length]),
  full: () => (document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen()),
  list: () => (part("keys").hidden = !part("keys").hidden),
  close: () => (part("keys").hidden = true),
  figures: () => document.body.classList.toggle("lrf3d-numbers"),
  picture() {
    scene.render();
    scene.canvas.toBlob((picture) => {
      const href = URL.createObjectURL(picture);
      Object.assign(document.createElement("a"), { href, download: `${setup.title}_${part("t").textContent}s.png` }).click();
      URL.revokeObjectURL(href);
    });
  },
};
const KEYS = {
  KeyV: "next", KeyF: "full", KeyP: "picture", KeyH: "list", KeyN: "figures", Escape: "close",
  ...(plays && { Space: "play", ArrowLeft: "rewind", ArrowRight: "skip", Home: "begin", End: "end" }),
};
const PADS = {
  ArrowUp: "ahead", KeyW: "ahead", ArrowDown: "back", KeyS: "back",
  ArrowLeft: "left", KeyA: "left", ArrowRight: "right", KeyD: "right",
};

// Ask for what is to be seen, one question at a time, and not the same again: the answer would be that nothing has changed.
function ask() {
  const { ahead, back, left, right } = held;
  const { width, height } = scene.canvas;
  // In upright pictures pads lie below what is looked at, in wide ones beside it.
  const controls = part(innerWidth < innerHeight ? "bottom" : "bar").getBoundingClientRect();
  const below = Math.max(0, 1 - controls.top / innerHeight);
  if (below !== scene.below) Object.assign(scene, { below, stale: true });
  const wish = plays ? { time } : { drive, forward: ahead - back, turn: left - right, ...goal };
  const text = JSON.stringify({ view, width, height: Math.max(16, Math.round(height * (1 - below))), ...wish });
  if (waiting || text === asked) return;
  [asked, waiting] = [text, true];
  answers.ask(text);
}

function take(header, block) {
  waiting = false;
  if (!header) return;
  scene.take(header, block);
  for (const [name, words] of Object.entries(header.words)) part(name).textContent = words;
  if (part("failure")) {
    part("failure").remove();
    if (plays) play(true);
  }
  // A robot that has moved moves on, however slowly this page draws: the same question is asked again.
  if (!plays) asked = "";
  ask();
}

function frame(now) {
  const seconds = Math.min(LONGEST, (now - last) / 1000);
  last = now;
  if (playing) move(later(seconds * speed));
  if (playing && time >= limits()[1]) play(false);
  ask();
  if (scene.stale) scene.render();
  requestAnimationFrame(frame);
}

// The time after some seconds of the run: a story leaves out parts of it, and passes others quickly.
function later(seconds) {
  const [, end, rate] = (view === "story" && setup.rates.find(([from, to]) => time >= from && time < to)) || [0, Infinity, 1];
  return Math.min(time + rate * seconds, end);
}

// From when to when there is something to see: a story begins before the run and ends after it.
function limits() {
  return view === "story" ? setup.story : [0, setup.end];
}

function move(to) {
  const [min, max] = limits();
  time = Math.min(max, Math.max(min, to));
  Object.assign(part("slider"), { min, max, value: time });
  part("clock").textContent = `${clock(time)} / ${clock(setup.end)}`;
}

function clock(seconds) {
  const whole = Math.floor(Math.min(setup.end, Math.max(0, seconds)));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

function play(on) {
  if (on && time >= limits()[1]) move(limits()[0]);
  playing = on;
  part("play").textContent = on ? "❚❚" : "▶";
  part("play").setAttribute("aria-label", on ? "pause" : "play");
}

function choose(chosen) {
  view = chosen;
  turn(STRAIGHT);
  move(time);
  for (const button of viewButtons) button.setAttribute("aria-pressed", button.dataset.view === view);
}

function hold(pad, on) {
  held[pad] = on;
  document.querySelector(`[data-pad=${pad}]`).classList.toggle("lrf3d-held", on);
}

// A click on the ground sends the robot there; where it was held down before a drag, the drag is the heading.
function point({ clientX, clientY }) {
  const place = press && scene.ground(press.x, press.y);
  if (!place) return;
  const to = heldStill() ? scene.ground(clientX, clientY) : null;
  const turned = to && Math.hypot(clientX - press.x, clientY - press.y) > STILL;
  const heading = turned ? Math.atan2(to[1] - place[1], to[0] - place[0]) : undefined;
  if (!press.moved || turned) goal = { goal: goal.goal + 1, x: place[0], y: place[1], ...(turned ? { heading } : { heading: 9 }) };
}

// Whether the ground was held down before the finger moved.
const heldStill = () => (press.moved ?? performance.now()) - press.time > HOLD;

// A drag turns the camera; with two fingers it comes nearer as they part.
function drag(event) {
  const before = fingers.get(event.pointerId);
  if (press && !press.moved && Math.hypot(event.clientX - press.x, event.clientY - press.y) > STILL) press.moved = performance.now();
  if (press && heldStill()) return;
  if (!before || !["follow", "orbit"].includes(view)) return;
  const now = [event.clientX, event.clientY];
  const other = [...fingers.keys()].find((id) => id !== event.pointerId);
  const apart = ([x, y]) => Math.hypot(x - fingers.get(other)[0], y - fingers.get(other)[1]);
  if (other !== undefined) zoom(apart(before) / apart(now));
  else {
    const { around, over } = scene.hand;
    turn({ around: around - TURN * (now[0] - before[0]), over: over + TURN * (now[1] - before[1]) });
  }
  fingers.set(event.pointerId, now);
}

function zoom(by) {
  if (["follow", "orbit"].includes(view)) turn({ zoom: Math.min(4, Math.max(0.2, scene.hand.zoom * by)) });
}

// Turn the camera by hand.
function turn(by) {
  Object.assign(scene, { hand: { ...scene.hand, ...by }, stale: true });
}

function key(event) {
  const { code, target, type, repeat } = event;
  if (event.ctrlKey || event.metaKey || event.altKey || target.matches("select")) return;
  const presses = ["Enter", "Space"].includes(code);
  const pad = presses ? target.dataset.pad : !plays && PADS[code];
  if (pad) hold(pad, type === "keydown");
  // A button that has the focus is pressed by the space bar itself.
  else if (type === "keyup" || !KEYS[code] || (presses && target.matches("button"))) return;
  else if (!repeat || code.startsWith("Arrow")) ACTIONS[KEYS[code]]();
  event.preventDefault();
}

// Give the controls what they do.
function connect() {
  for (const button of viewButtons) button.onclick = () => choose(button.dataset.view);
  for (const button of document.querySelectorAll("[data-do]")) button.onclick = ACTIONS[button.dataset.do];
  for (const value of [...new Set([...SPEEDS, speed])].sort((a, b) => a - b)) {
    part("speed").append(new Option(`${value}×`, value, false, value === speed));
  }
  part("speed").onchange = (event) => (speed = Number(event.target.value));
  part("slider").oninput = (event) => move(Number(event.target.value));
  for (const pad of document.querySelectorAll("[data-pad]")) {
    pad.onpointerdown = (event) => {
      pad.setPointerCapture(event.pointerId);
      hold(pad.dataset.pad, true);
    };
    pad.onlostpointercapture = pad.onblur = () => hold(pad.dataset.pad, false);
    pad.oncontextmenu = () => false;
  }
  const canvas = part("scene");
  canvas.onpointerdown = (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    press = plays || fingers.size > 1 ? null : { x: event.clientX, y: event.clientY, time: performance.now() };
  };
  canvas.onpointerup = point;
  canvas.onpointermove = drag;
  canvas.onlostpointercapture = (event) => fingers.delete(event.pointerId);
  canvas.addEventListener("wheel", (event) => zoom(Math.exp(ZOOM * event.deltaY)), { passive: true });
  document.onkeydown = document.onkeyup = key;
  window.onblur = () => Object.keys(held).forEach((pad) => hold(pad, false));
}

async function start() {
  connect();
  // The page is painted before the scene is made ready.
  await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
  const coming = source(take, (words) => (part("stop").textContent = words));
  scene = new Scene(part("scene"), part("inset"));
  answers = await coming;
  scene.load(...answers.world, answers.ground);
  // A story shows where most happens.
  choose(views[0]);
  move(limits()[0]);
  requestAnimationFrame(frame);
}

start().catch((error) => {
  part("failure").textContent = `This browser cannot show the scene: ${error.message}`;
  throw error;
});
