// The page: asks the server for moments of a run or has the robot drive, and shows what comes.

import { Rig } from "./rig.js";
import { World } from "./world.js";

const SPEEDS = [0.5, 1, 2, 4, 8, 16];
const STEP = 2; // Seconds that an arrow key skips.
const LONGEST = 0.5; // Seconds that a frame stands for at most: a hidden page draws none.
const NAMES = { story: "Story", follow: "Follow", orbit: "Orbit", top: "Above", first: "Eyes" };
const WAYS = {
  ArrowUp: "ahead", KeyW: "ahead", ArrowDown: "back", KeyS: "back",
  ArrowLeft: "left", KeyA: "left", ArrowRight: "right", KeyD: "right",
};

const setup = JSON.parse(document.querySelector("#setup").textContent);
const plays = setup.end > 0;
const part = (name) => document.querySelector(`.lrf3d-${name}`);
const held = { ahead: false, back: false, left: false, right: false };
let [time, speed, playing, waiting, asked, last] = [0, setup.speed, plays, true, "", performance.now()];
let world, rig, socket;

function ask(more = {}) {
  const { ahead, back, left, right } = held;
  const wish = plays ? { time } : { forward: ahead - back, turn: left - right };
  const aspect = Number((world.canvas.clientWidth / world.canvas.clientHeight).toFixed(3));
  const eye = rig.eye?.map((value) => Number(value.toFixed(2)));
  const text = JSON.stringify({ view: rig.view, aspect, eye, ...wish, ...more });
  // A run is asked for moment by moment; a drive sends what it has by itself.
  if (text === asked || (plays && waiting)) return;
  [asked, waiting] = [text, true];
  socket.send(text);
}

function take(data) {
  waiting = false;
  if (!data.byteLength) return;
  const length = new DataView(data).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  world.take(header, data.slice(4 + length));
  if (header.camera) rig.tell(header.camera);
  for (const [name, words] of Object.entries(header.words ?? {})) part(name).textContent = words;
  if (header.plan) scale(header.plan);
  part("failure")?.remove();
}

function scale([, , window, metres]) {
  part("scale").textContent = `${metres} m`;
  part("scale").style.width = `${(100 * metres) / window}%`;
}

function frame(now) {
  const seconds = Math.min(LONGEST, (now - last) / 1000);
  last = now;
  if (playing) move(time + seconds * speed);
  if (playing && time >= limits()[1]) play(false);
  if (rig.view) {
    ask();
    rig.update(seconds);
    if (world.stale) world.render();
  }
  requestAnimationFrame(frame);
}

// From when to when there is something to see: a story begins before the run and ends after it.
function limits() {
  return rig.view === "story" ? setup.story : [0, setup.end];
}

function move(to) {
  const [first, end] = limits();
  time = Math.min(end, Math.max(first, to));
  Object.assign(part("slider"), { min: first, max: end, value: time });
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

function choose(view) {
  rig.choose(view);
  if (plays) move(time);
  for (const button of part("views").children) {
    button.setAttribute("aria-pressed", button.dataset.view === view);
  }
}

function hold(way, on) {
  held[way] = on;
  document.querySelector(`[data-way=${way}]`).classList.toggle("lrf3d-held", on);
}

const TOOLS = {
  picture() {
    world.render();
    world.canvas.toBlob((picture) => {
      const link = document.createElement("a");
      link.href = URL.createObjectURL(picture);
      link.download = `${setup.title}_${part("t").textContent}s.png`;
      link.click();
      URL.revokeObjectURL(link.href);
    });
  },
  full: () => (document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen()),
  list: () => (part("keys").hidden = !part("keys").hidden),
};

function key(event) {
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  const down = event.type === "keydown";
  const pad = event.target.dataset?.way;
  const tool = { KeyP: "picture", KeyF: "full", KeyH: "list" }[event.code];
  if (pad && ["Enter", "Space"].includes(event.code)) hold(pad, down);
  else if (!plays && WAYS[event.code]) hold(WAYS[event.code], down);
  else if (!down) return;
  else if (event.code === "KeyV") choose(setup.views[(setup.views.indexOf(rig.view) + 1) % setup.views.length]);
  else if (tool && !event.repeat) TOOLS[tool]();
  else if (plays && !event.target.matches("select") && skip(event)) part("slider").blur();
  else return;
  event.preventDefault();
}

function skip({ code, target }) {
  const to = { ArrowLeft: time - STEP, ArrowRight: time + STEP, Home: limits()[0], End: limits()[1] }[code];
  if (to !== undefined) move(to);
  // A button that has the focus is pressed by the space bar itself.
  else if (code === "Space" && !target.matches("button")) play(!playing);
  else return false;
  return true;
}

function dress() {
  document.body.classList.add(plays ? "lrf3d-plays" : "lrf3d-drives");
  part(plays ? "driving" : "playing").remove();
  for (const view of setup.views) {
    const button = document.createElement("button");
    button.className = `lrf3d-view-${view}`;
    button.dataset.view = view;
    button.textContent = NAMES[view];
    button.onclick = () => choose(view);
    part("views").append(button);
  }
  for (const name of Object.keys(TOOLS)) part(name).onclick = TOOLS[name];
  const keys = plays
    ? { Space: "play, pause", "← →": "two seconds back, ahead", "Home End": "to the start, to the end" }
    : { "W A S D, arrows": "drive" };
  Object.assign(keys, { V: "next view", F: "full screen", P: "save a picture", H: "this list", "Drag, wheel": "turn, zoom" });
  for (const [name, what] of Object.entries(keys)) {
    for (const [tag, text] of [["dt", name], ["dd", what]]) {
      part("keys").append(Object.assign(document.createElement(tag), { textContent: text }));
    }
  }
  part("truth").style.color = `rgb(${setup.trail})`;
  part("believed").style.color = `rgb(${setup.estimate})`;
  if (plays) {
    for (const value of [...new Set([...SPEEDS, speed])].sort((a, b) => a - b)) {
      part("speed").append(new Option(`${value}×`, value, false, value === speed));
    }
    part("speed").onchange = (event) => (speed = Number(event.target.value));
    part("slider").oninput = (event) => move(Number(event.target.value));
    part("play").onclick = () => play(!playing);
  } else {
    part("again").onclick = () => ask({ again: true });
  }
  for (const pad of document.querySelectorAll(".lrf3d-pad")) {
    const way = pad.dataset.way;
    pad.addEventListener("pointerdown", (event) => {
      pad.setPointerCapture(event.pointerId);
      hold(way, true);
    });
    for (const end of ["pointerup", "pointercancel", "lostpointercapture", "blur"]) {
      pad.addEventListener(end, () => hold(way, false));
    }
    pad.addEventListener("contextmenu", (event) => event.preventDefault());
  }
  document.addEventListener("keydown", key);
  document.addEventListener("keyup", key);
  window.addEventListener("blur", () => Object.keys(held).forEach((way) => hold(way, false)));
}

async function start() {
  dress();
  // The page is painted before the scene is made ready.
  await new Promise((done) => requestAnimationFrame(() => setTimeout(done)));
  socket = new WebSocket(`ws://${location.host}/lrf3d/moments`);
  socket.binaryType = "arraybuffer";
  world = new World(part("scene"), part("inset"), setup);
  rig = new Rig(world, setup);
  const open = new Promise((done) => (socket.onopen = done));
  const early = [];
  socket.onmessage = (event) => early.push(event.data);
  await Promise.all([open, world.load("/lrf3d/world.glb")]);
  socket.onmessage = (event) => take(event.data);
  socket.onclose = () => (part("hud").lastElementChild.textContent = "the server has ended");
  choose(setup.views.includes("story") && location.hash === "#story" ? "story" : "follow");
  if (plays) play(true);
  early.forEach(take);
  waiting = false;
  requestAnimationFrame(frame);
}

start().catch((error) => {
  part("failure").textContent = `This browser cannot show the scene: ${error.message}`;
  throw error;
});
