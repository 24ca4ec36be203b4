// What the page shows comes from its server: the world, and moments as answers to its questions.

import { unpacked } from "./scene.js";

// Answers go to a function: a header and arrays, or nothing where nothing has changed.
export async function source(take, ended) {
  const socket = new WebSocket(`ws://${location.host}/lrf3d/moments`);
  socket.binaryType = "arraybuffer";
  socket.onmessage = ({ data }) => take(...(data.byteLength ? unpacked(data) : []));
  socket.onclose = () => ended("the server has ended");
  const [world, ground] = await Promise.all([
    fetch("/lrf3d/world").then((answer) => answer.arrayBuffer()),
    fetch("/lrf3d/ground.jpg").then(async (answer) => createImageBitmap(await answer.blob())),
    new Promise((done) => (socket.onopen = done)),
  ]);
  return { world: unpacked(world), ground, ask: (text) => socket.send(text) };
}
