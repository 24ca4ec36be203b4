// Draws the scene as the film does: with its shaders, in its order, from arrays as they come.

const HEAD = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2DArray;
`;

export class Scene {
  constructor(canvas, inset) {
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: true });
    if (!gl) throw new Error("it has no WebGL 2");
    Object.assign(this, { canvas, inset, gl, programs: {}, marks: {}, stale: true });
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
  load({ programs, area, back, marks: { facades, ...marks } }, block, picture) {
    const { gl } = this;
    for (const [name, sources] of Object.entries(programs)) this.programs[name] = this.program(sources);
    const [wide, high, count] = facades.size;
    const texels = block.subarray(facades.columns[0][1]);
    this.facades = this.texture(gl.TEXTURE_2D_ARRAY, gl.REPEAT);
    gl.texImage3D(gl.TEXTURE_2D_ARRAY, 0, gl.RGBA8, wide, high, count, 0, gl.RGBA, gl.UNSIGNED_BYTE, texels);
    gl.generateMipmap(gl.TEXTURE_2D_ARRAY);
    this.pavement = this.texture(gl.TEXTURE_2D, gl.CLAMP_TO_EDGE);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB8, gl.RGB, gl.UNSIGNED_BYTE, picture);
    gl.generateMipmap(gl.TEXTURE_2D);
    gl.clearColor(...back, 1);
    this.area = area;
    this.take({ marks }, block);
  }

  texture(kind, wrap) {
    const { gl } = this;
    const made = gl.createTexture();
    gl.bindTexture(kind, made);
    gl.texParameteri(kind, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_NEAREST);
    for (const axis of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(kind, axis, wrap);
    return made;
  }

  program(sources) {
    const { gl } = this;
    const made = gl.createProgram();
    [gl.VERTEX_SHADER, gl.FRAGMENT_SHADER].forEach((kind, i) => {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, HEAD + sources[i]);
      gl.compileShader(shader);
      gl.attachShader(made, shader);
    });
    gl.linkProgram(made);
    return made;
  }

  // The uniforms of a program, which is asked for them when it is first used: until then drivers compile.
  uniforms(made) {
    const { gl } = this;
    if (made.places) return made.places;
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) {
      const logs = gl.getAttachedShaders(made).map((shader) => gl.getShaderInfoLog(shader));
      throw new Error(`a shader does not compile: ${gl.getProgramInfoLog(made)} ${logs.join(" ")}`);
    }
    const count = gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS);
    const names = Array.from({ length: count }, (_, i) => gl.getActiveUniform(made, i).name);
    return (made.places = names.map((name) => [name, gl.getUniformLocation(made, name)]));
  }

  // Take a message of the server: marks in the order in which they are drawn, the rest of its header, and its arrays.
  take({ marks, ...state }, block) {
    for (const [name, { columns, ...style }] of Object.entries(marks)) {
      const mark = (this.marks[name] ??= { vertices: this.gl.createVertexArray(), columns: [], count: 0 });
      Object.assign(mark, style);
      for (const column of columns) this.fill(mark, column, block);
    }
    Object.assign(this, state, { order: Object.keys(marks) });
    this.inset.hidden = !this.plan;
    this.stale = true;
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
    const places = this.uniforms(this.programs[name]);
    gl.useProgram(this.programs[name]);
    for (const [uniform, place] of places) {
      const value = uniforms[uniform];
      if (value?.length === 16) gl.uniformMatrix4fv(place, false, value);
      else if (value?.length) gl[`uniform${value.length}fv`](place, value);
      else if (value !== undefined) gl.uniform1f(place, value);
    }
    gl.bindVertexArray(mark.vertices);
    if (mark.kind === "lines") gl.drawArraysInstanced(gl.TRIANGLE_FAN, 0, 4, mark.count);
    else gl.drawArrays(mode, 0, mark.count);
  }

  render() {
    const { gl, canvas, camera, marks, plan } = this;
    if (!camera) return;
    this.see(camera, [0, 0, canvas.width, canvas.height]);
    gl.depthMask(true);
    gl.clear(gl.DEPTH_BUFFER_BIT);
    const bodies = this.shown(false).filter(({ kind }) => kind === "faces");
    for (const body of [...bodies, marks.land]) this.paint("faces", body, body);
    gl.bindTexture(gl.TEXTURE_2D, this.pavement);
    this.paint("ground", marks.ground, { area: this.area });
    this.paint("sky", marks.sky, { ray_from_corner: camera.ray });
    // The nearest walls alone are seen through where they fade.
    gl.colorMask(!camera.ghost, !camera.ghost, !camera.ghost, true);
    this.paintWalls();
    gl.colorMask(true, true, true, true);
    if (camera.ghost) this.paintWalls();
    for (const mark of this.shown(false)) this.paintMark(mark);
    if (plan) this.paintPlan();
    this.stale = false;
  }

  // The marks of the scene or of the plan, in their order.
  shown(plan) {
    return this.order.filter((name) => name.startsWith("plan ") === plan).map((name) => this.marks[name]);
  }

  paintWalls() {
    const { gl, camera, marks } = this;
    const how = { cull: true, blend: camera.ghost > 0, solid: true };
    const faded = camera.ghost ? ":FADED" : "";
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, this.facades);
    this.paint(`walls:PLAIN${faded}`, marks.plain, camera, how);
    this.paint(`walls${faded}`, marks.walls, camera, how);
  }

  paintMark(mark) {
    const { gl, camera: { scale } } = this;
    if (mark.kind === "points") {
      const sizes = [mark.size * this.focus, ...mark.pixels.map((size) => scale * size)];
      this.paint(mark.glows ? "points:GLOW_ROUND" : "points", mark, { sizes }, { mode: gl.POINTS, blend: true });
    } else if (mark.kind === "lines") {
      gl.depthFunc(mark.hidden ? gl.GREATER : gl.LEQUAL);
      this.paint(mark.hidden ? "lines:DASHED" : "lines", mark, { width: mark.width * scale }, { blend: true });
      gl.depthFunc(gl.LEQUAL);
    } else if (mark.kind === "soft") {
      this.paint("soft", mark, {}, { blend: true });
    }
  }

  // The map from above, in a corner of the picture.
  paintPlan() {
    const { gl, canvas, ratio, plan } = this;
    const { left, top, width: side } = this.inset.getBoundingClientRect();
    const box = [left, canvas.clientHeight - top - side, side, side].map((value) => Math.round(ratio * value));
    gl.disable(gl.DEPTH_TEST);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(...box);
    gl.clear(gl.COLOR_BUFFER_BIT);
    this.see(plan, box);
    for (const mark of this.shown(true)) this.paintMark(mark);
    gl.disable(gl.SCISSOR_TEST);
    gl.enable(gl.DEPTH_TEST);
  }
}
