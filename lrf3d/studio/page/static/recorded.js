// What the page shows lies in its file: the world, and recorded moments.

import { unpacked } from "./scene.js";

const GLIDE = 0.05; // How far an eye moves between two moments, in its distance, if what it sees glides: near ones would leave the beams behind.
async function bytesOf(id, open = true) {
  const element = document.querySelector(`#${id}`);
  const bytes = Uint8Array.from(atob(element.textContent), (letter) => letter.charCodeAt(0));
  element.remove();
  const stream = new Blob([bytes]).stream();
  return new Response(open ? stream.pipeThrough(new DecompressionStream("gzip")) : stream).arrayBuffer();
}

// An array of the record: differences of its rows, column by column, low bytes first.
function decoded(bytes, [start, rows, columns, size, exponent]) {
  const numbers = new (size === 1 ? Uint8Array : size ? Float32Array : Uint16Array)(rows * columns);
  const wide = size || 2, shift = 32 - 8 * wide, unit = 2 ** exponent;
  for (let column = 0; column < columns; column++) {
    for (let row = 0, sum = 0, at = start + column * rows * wide; row < rows; row++, at++) {
      for (let plane = 0; plane < wide; plane++) sum += bytes[at + plane * rows] << (8 * plane);
      sum |= 0;
      numbers[row * columns + column] = ((sum << shift) >> shift) * unit;
    }
  }
  return numbers;
}

// Numbers between two, and lists of them.
function between(one, other, share) {
  return Array.isArray(one) ? one.map((each, i) => between(each, other[i], share)) : one + share * (other - one);
}

// Answers go to a function: a header and arrays.
export async function source(take) {
  const [text, block, data, picture] = await Promise.all(
    ["recording", "arrays", "world", "ground"].map((id) => bytesOf(id, id !== "ground")),
  );
  const { step, views, arrays, times } = JSON.parse(new TextDecoder().decode(text));
  const bytes = new Uint8Array(block);
  const sent = {}; // The number of the array that each column of a mark has.

  // The new columns of a mark, which are put after other arrays.
  function columnsOf(name, numbers, lists) {
    const before = sent[name] ?? [];
    sent[name] = numbers;
    return numbers.flatMap((number, i) => {
      if (before[i] === number) return [];
      const array = decoded(bytes, arrays[number]);
      const size = array instanceof Uint8Array ? 0 : arrays[number][2];
      lists.push(new Uint8Array(array.buffer));
      lists.size += array.byteLength;
      return [[i, lists.size - array.byteLength, size, 0, array.length / (size || 4)]];
    });
  }

  function ask(question) {
    const wish = JSON.parse(question);
    const shape = wish.width < wish.height ? "tall" : "wide";
    const moments = views[`${wish.view} ${shape}`];
    // A story begins before the run.
    const first = wish.view === "story" ? Math.floor(JSON.parse(document.querySelector("#setup").textContent).story[0] / step) : 0;
    const at = Math.min(Math.max(wish.time / step - first, 0), moments.length - 1);
    const moment = moments[Math.floor(at)];
    const next = moments[Math.min(Math.floor(at) + 1, moments.length - 1)];
    const moved = Math.hypot(...moment.camera.eye.map((each, i) => each - next.camera.eye[i]));
    const away = Math.hypot(...moment.camera.eye.map((each, i) => each - moment.camera.target[i]));
    const share = moved < GLIDE * away ? at % 1 : 0;
    const camera = { ...moment.camera };
    for (const name of ["matrix", "eye", "target", "focus", "clock", "thick", ...(camera.robot && next.camera.robot ? ["robot"] : [])]) {
      camera[name] = between(camera[name], next.camera[name], share);
    }
    const lists = Object.assign([], { size: 0 });
    const marks = {};
    for (const [name, { columns, ...style }] of Object.entries(moment.marks)) {
      const pose = style.pose && next.marks[name] ? { pose: between(style.pose, next.marks[name].pose, share) } : {};
      marks[name] = { ...style, ...pose, columns: columnsOf(name, columns, lists) };
    }
    if (!sent.times) marks.times = { ...times[0], columns: columnsOf("times", [times[1]], lists) };
    const arraysNow = new Uint8Array(lists.size);
    lists.reduce((end, list) => (arraysNow.set(list, end), end + list.length), 0);
    take({ ...moment, camera, marks }, arraysNow);
  }
  return { world: unpacked(data), ground: await createImageBitmap(new Blob([picture])), ask };
}
