// Draws the scene as the film does: with its shaders, in its order, from arrays as they come.

const HEAD = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
`;

const LOWEST = 0.07, STEEPEST = 1.536; // How steeply a look that a hand has turned goes down [rad].
const NEARER = 0.03; // How far before its wall a mirror stands [m].

// A camera for a picture of a size, fitted into this one, over its controls, and turned by hand about its target.
function fitted(camera, { around, over, zoom }, below, { width, height }, size) {
  const { target, eye } = camera, free = 1 - below;
  const away = eye.map((each, i) => each - target[i]);
  const level = Math.hypot(away[0], away[1]), steep = Math.atan2(away[2], level);
  const rise = over ? Math.min(Math.max(steep + over, LOWEST), STEEPEST) - steep : 0;
  const degrees = 180 / Math.PI;
  const world = new DOMMatrix().translate(...target).rotateAxisAngle(0, 0, 1, around * degrees);
  world.rotateAxisAngleSelf(away[1], -away[0], 0, level ? rise * degrees : 0);
  world.scaleSelf(zoom, zoom, zoom).translateSelf(...target.map((each) => -each));
  const aspect = width / (height * free), own = size[0] / size[1];
  const [wide, tall] = aspect > own ? [own / aspect, 1] : [1, aspect / own];
  const fit = new DOMMatrix([wide * zoom, 0, 0, 0, 0, free * tall * zoom, 0, 0, 0, 0, zoom, 0, 0, below * zoom, 0, zoom]);
  const matrix = fit.multiply(new DOMMatrix(camera.matrix)).multiply(world.inverse());
  const { x, y, z } = world.transformPoint(new DOMPoint(...eye));
  return { ...camera, eye: [x, y, z], focus: (camera.focus * free * tall * height) / size[1], matrix: [...matrix.toFloat64Array()] };
}

// What a mirror shows to a camera: from where, and the corners of the rectangle that closes it; nothing if it is out of sight.
function reflection([x, y, u, v, high], camera) {
  const { eye, cut } = camera, matrix = new DOMMatrix(camera.matrix);
  const length = Math.hypot(u - x, v - y), top = Math.min(high, cut);
  const [along, across] = [(u - x) / length, (v - y) / length];
  const [nx, ny] = [-across, along];
  const off = nx * (eye[0] - x) + ny * (eye[1] - y), shift = 2 * (nx * x + ny * y);
  const before = Math.sign(off) * NEARER;
  const ends = [[x, y], [u, v]].map(([a, b]) => [a + before * nx, b + before * ny]);
  const seal = [[0, 0], [1, 0], [1, top], [0, 0], [1, top], [0, top]].map(([end, z]) => [...ends[end], z]);
  const seen = seal.map((place) => matrix.transformPoint(new DOMPoint(...place)));
  const out = (side) => seen.every((place) => side(place) + place.w < 0);
  if (!off || [(p) => p.x, (p) => -p.x, (p) => p.y, (p) => -p.y, () => 0].some(out)) return null;
  const turn = [1 - 2 * nx * nx, -2 * nx * ny, 0, 0, -2 * nx * ny, 1 - 2 * ny * ny, 0, 0, 0, 0, 1, 0, nx * shift, ny * shift, 0, 1];
  const from = { eye: [eye[0] - 2 * off * nx, eye[1] - 2 * off * ny, eye[2]], matrix: [...matrix.multiply(new DOMMatrix(turn)).toFloat64Array()] };
  return { ...camera, ...from, mirror: [x, y, along, across], mirror_size: [length, top, off], seal: new Float32Array(seal.flat()) };
}

// The header and the arrays of a message.
export function unpacked(data) {
  const length = new DataView(data).getUint32(0, true);
  return [JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length))), new Uint8Array(data, 4 + length)];
}

export class Scene {
  constructor(canvas, inset) {
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: true });
    if (!gl) throw new Error("it has no WebGL 2");
    Object.assign(this, { canvas, inset, gl, programs: {}, marks: {}, hand: {}, below: 0, stale: true });
    gl.bindBufferBase(gl.UNIFORM_BUFFER, 0, gl.createBuffer());
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  resize() {
    const { canvas } = this;
    this.ratio = Math.min(window.devicePixelRatio, 2);
    canvas.width = Math.max(16, Math.round(this.ratio * canvas.clientWidth));
    canvas.height = Math.max(16, Math.round(this.ratio * canvas.clientHeight));
    this.stale = true;
  }

  // What stands in the world, and the picture of its ground.
  load({ programs, area, grid, cells, back, mirrors, leastScale, marks }, block, picture) {
    const { gl } = this;
    Object.assign(this, { sources: programs, back, cells, area, grid, mirrors, leastScale });
    this.pavement = this.texture();
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB8, gl.RGB, gl.UNSIGNED_BYTE, picture);
    gl.generateMipmap(gl.TEXTURE_2D);
    // When each cell of the ground was first seen, and the map in the same cells, on units of their own.
    [this.times, this.tintMap] = [gl.RGBA16F, gl.RGBA8].map((kind, i) => {
      gl.activeTexture(gl.TEXTURE2 + i);
      const made = this.texture(gl.LINEAR);
      gl.texStorage2D(gl.TEXTURE_2D, 1, kind, ...cells);
      return made;
    });
    gl.activeTexture(gl.TEXTURE0);
    this.frame = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.tintMap, 0);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    this.take({ marks }, block);
  }

  texture(filter = this.gl.LINEAR_MIPMAP_NEAREST) {
    const { gl } = this;
    const made = gl.createTexture();
    gl.bindTexture(gl.TEXTURE_2D, made);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, filter);
    for (const axis of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, axis, gl.CLAMP_TO_EDGE);
    return made;
  }

  // A program of a name, compiled when it is first used.
  use(name) {
    const { gl } = this;
    const made = (this.programs[name] ??= gl.createProgram());
    if (made.places) {
      gl.useProgram(made);
      return made.places;
    }
    [gl.VERTEX_SHADER, gl.FRAGMENT_SHADER].forEach((kind, i) => {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, HEAD + this.sources[name][i]);
      gl.compileShader(shader);
      gl.attachShader(made, shader);
    });
    gl.linkProgram(made);
    gl.useProgram(made);
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) {
      const logs = gl.getAttachedShaders(made).map((shader) => gl.getShaderInfoLog(shader));
      throw new Error(`a shader does not compile: ${gl.getProgramInfoLog(made)} ${logs.join(" ")}`);
    }
    const count = gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS);
    const names = Array.from({ length: count }, (_, i) => gl.getActiveUniform(made, i).name);
    const places = names.map((name) => [name, gl.getUniformLocation(made, name)]);
    const units = { picture: 0, times: 2, tints: 3 };
    for (const [name, place] of places) if (name in units) gl.uniform1i(place, units[name]);
    return (made.places = places.filter(([name]) => !(name in units)));
  }

  // Take a message of the server: marks in the order in which they are drawn, the rest of its header, and its arrays.
  take({ marks: { times, ...marks }, camera, ...state }, block) {
    if (times) this.light(times, block);
    if (marks.tints?.columns.length) this.tinted = false;
    for (const [name, { columns, ...style }] of Object.entries(marks)) {
      const mark = (this.marks[name] ??= { vertices: this.gl.createVertexArray(), columns: [], count: 0 });
      Object.assign(mark, style);
      for (const column of columns) this.fill(mark, column, block);
    }
    Object.assign(this, state, { given: camera, order: Object.keys(marks) });
    this.inset.hidden = !this.plan;
    this.stale = true;
  }

  // Take the times of a box of cells, in half floats.
  light({ box, columns: [[, start]] }, block) {
    const { gl } = this;
    const halves = new Uint16Array(block.slice(start, start + 8 * box[2] * box[3]).buffer);
    gl.activeTexture(gl.TEXTURE2);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, ...box, gl.RGBA, gl.HALF_FLOAT, halves);
    gl.activeTexture(gl.TEXTURE0);
  }

  // Rewrite an attribute: its rows before the first new one stay. Each has some floats, or a colour in four bytes (size 0).
  fill(mark, [place, start, size, first, count], block) {
    const { gl } = this;
    const stride = 4 * (size || 1);
    const column = (mark.columns[place] ??= { buffer: gl.createBuffer(), rows: new Uint8Array() });
    const rows = new Uint8Array(stride * count);
    rows.set(column.rows.subarray(0, stride * first));
    rows.set(block.subarray(start, start + stride * (count - first)), stride * first);
    gl.bindVertexArray(mark.vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, column.buffer);
    gl.bufferData(gl.ARRAY_BUFFER, rows, gl.DYNAMIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size || 4, size ? gl.FLOAT : gl.UNSIGNED_BYTE, !size, 0, 0);
    gl.vertexAttribDivisor(place, mark.kind === "lines" ? 1 : 0);
    [column.rows, mark.count] = [rows, count];
  }

  // Draw with a camera into a box of the canvas: left, bottom, width, height.
  // The place on the ground, about the middle of the world, that is seen at a point of the page; null for the sky.
  ground(x, y) {
    const { clientWidth, clientHeight } = this.canvas;
    const back = new DOMMatrix(this.camera.matrix).inverse();
    const at = (z) => {
      const point = back.transformPoint(new DOMPoint((2 * x) / clientWidth - 1, 1 - (2 * y) / clientHeight, z));
      return [point.x / point.w, point.y / point.w, point.z / point.w];
    };
    const [one, two] = [at(0.2), at(0.8)], { eye } = this.camera;
    const way = two.map((each, i) => each - one[i]), far = one[2] / -way[2];
    const place = one.map((each, i) => each + far * way[i]);
    // Behind the camera, the line meets the ground, too.
    const ahead = place.reduce((sum, each, i) => sum + (each - eye[i]) * (one[i] - eye[i]), 0);
    return ahead > 0 && Number.isFinite(far) ? place.slice(0, 2) : null;
  }

  see({ matrix, eye, thick, slack, nearer, focus }, box) {
    const { gl } = this;
    gl.viewport(...box);
    const camera = new Float32Array([...matrix, ...eye, thick, box[2], box[3], slack, nearer]);
    gl.bufferData(gl.UNIFORM_BUFFER, camera, gl.DYNAMIC_DRAW);
    this.focus = focus;
  }

  // Draw a mark with a program; values that its uniforms do not have are passed over.
  paint(name, mark, uniforms = {}, { mode = this.gl.TRIANGLES, blend = false, cull = false, solid = !blend } = {}) {
    const { gl } = this;
    if (!mark.count) return;
    (blend ? gl.enable : gl.disable).call(gl, gl.BLEND);
    (cull ? gl.enable : gl.disable).call(gl, gl.CULL_FACE);
    gl.depthMask(solid);
    for (const [uniform, place] of this.use(name)) {
      const value = uniforms[uniform];
      if (value?.length === 16) gl.uniformMatrix4fv(place, false, value);
      else if (value?.length) gl[`uniform${value.length}fv`](place, value);
      else if (value != null) gl.uniform1f(place, value);
    }
    gl.bindVertexArray(mark.vertices);
    if (mark.kind === "lines") gl.drawArraysInstanced(gl.TRIANGLE_FAN, 0, 4, mark.count);
    else gl.drawArrays(mode, 0, mark.count);
  }

  render() {
    const { gl, canvas, marks, plan } = this;
    if (!this.given) return;
    const camera = (this.camera = fitted(this.given, this.hand, this.below, canvas, this.size));
    camera.scale = Math.max(Math.min(canvas.width, canvas.height) / 720, this.leastScale);
    this.laser = { grid: this.grid, area: this.area, clock: camera.clock, dusk: camera.dusk };
    this.paintTints();
    const box = [0, 0, canvas.width, canvas.height];
    gl.depthMask(true);
    gl.clearColor(...this.back, 1);
    gl.clear(gl.DEPTH_BUFFER_BIT | gl.COLOR_BUFFER_BIT); // No sky is drawn into mirrors.
    for (const mirror of this.mirrors) this.reflect(reflection(mirror, camera), box);
    this.see(camera, box);
    this.paintBodies("faces");
    this.paintWalls("", camera);
    this.paintGround("ground");
    this.paint("sky", marks.sky, { ray_from_corner: [...new DOMMatrix(camera.matrix).inverse().toFloat64Array()] });
    for (const mark of this.shown(false)) if (mark.kind !== "faces") this.paintMark(mark);
    if (plan) this.paintPlan();
    this.stale = false;
  }

  // The marks of the scene or of the plan, in their order.
  shown(plan) {
    return this.order.filter((name) => name !== "tints" && name.startsWith("plan ") === plan).map((name) => this.marks[name]);
  }

  // Draw the map into the picture that walls take its colours from, where it has changed.
  paintTints() {
    const { gl, tints, marks } = this;
    if (this.tinted || !tints) return;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.frame);
    gl.disable(gl.DEPTH_TEST);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT);
    this.see(tints, [0, 0, ...this.cells]);
    gl.blendFuncSeparate(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA, gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    this.paint("lines", marks.tints, { width: [marks.tints.width, 0] }, { blend: true });
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.enable(gl.DEPTH_TEST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    this.tinted = true;
  }

  // Draw what a mirror shows, and close it with its depth.
  reflect(mirror, box) {
    if (!mirror) return;
    const { gl, camera } = this;
    this.see(mirror, box);
    gl.frontFace(gl.CW);
    this.paintBodies("faces:MIRRORED", mirror);
    this.paintWalls(":MIRRORED", mirror);
    this.paintGround("ground:MIRRORED", mirror);
    gl.frontFace(gl.CCW);
    this.see(camera, box);
    gl.colorMask(false, false, false, false);
    gl.depthFunc(gl.ALWAYS);
    const pose = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];
    const seal = (this.seal ??= { vertices: gl.createVertexArray(), columns: [] });
    this.fill(seal, [0, 0, 3, 0, 6], new Uint8Array(mirror.seal.buffer));
    this.paint("faces", seal, { pose });
    gl.depthFunc(gl.LEQUAL);
    gl.colorMask(true, true, true, true);
  }

  paintBodies(program, uniforms = {}) {
    for (const body of this.shown(false)) if (body.kind === "faces") this.paint(program, body, { ...body, ...uniforms }, { cull: true });
  }

  paintGround(program, uniforms = {}, how = {}) {
    const { gl, laser, marks } = this;
    gl.bindTexture(gl.TEXTURE_2D, this.pavement);
    this.paint(program, marks.ground, { ...laser, ...uniforms }, how);
  }

  paintWalls(variant, uniforms) {
    this.paint(`walls${variant}`, this.marks.walls, { ...uniforms, ...this.laser }, { cull: true });
  }

  paintMark(mark) {
    const { gl, camera: { scale } } = this;
    if (mark.kind === "points") {
      const sizes = [mark.size * this.focus, ...mark.pixels.map((size) => scale * size)];
      this.paint(mark.glows ? "points:GLOW_ROUND" : "points", mark, { sizes }, { mode: gl.POINTS, blend: true });
    } else if (mark.kind === "lines") {
      this.paint("lines", mark, { width: [mark.width * scale, mark.thick * this.focus] }, { blend: true });
    } else if (mark.kind === "soft") {
      gl.depthFunc(mark.on_top ? gl.ALWAYS : gl.LEQUAL);
      this.paint("soft", mark, {}, { blend: true });
      gl.depthFunc(gl.LEQUAL);
    }
  }

  // The map from above, in a corner of the picture.
  paintPlan() {
    const { gl, canvas, ratio, plan } = this;
    const { left, top, width, height } = this.inset.getBoundingClientRect();
    const box = [left, canvas.clientHeight - top - height, width, height].map((value) => Math.round(ratio * value));
    gl.disable(gl.DEPTH_TEST);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(...box);
    gl.clear(gl.COLOR_BUFFER_BIT);
    this.see(plan, box);
    this.paintGround("ground:PLAN", {}, { blend: true });
    for (const mark of this.shown(true)) this.paintMark(mark);
    gl.disable(gl.SCISSOR_TEST);
    gl.enable(gl.DEPTH_TEST);
  }
}
