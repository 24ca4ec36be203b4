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
    Object.assign(this, { canvas, inset, gl, programs: {}, marks: {}, bodies: {}, order: [], stale: true });
    this.camera = new Float32Array(24);
    this.block = gl.createBuffer();
    gl.bindBufferBase(gl.UNIFORM_BUFFER, 0, this.block);
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
  load(header, block, picture) {
    const { gl } = this;
    this.area = header.area;
    for (const [name, sources] of Object.entries(header.programs)) this.programs[name] = this.program(name, sources);
    this.facades = this.texture(gl.TEXTURE_2D_ARRAY, gl.REPEAT);
    const levels = Object.values(header.marks).filter(({ kind }) => kind === "level");
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MAX_LEVEL, levels.length - 1);
    levels.forEach(({ shape, columns }, level) => {
      const texels = new Uint8Array(block, columns[0][1], 4 * shape[0] * shape[1] * shape[2]);
      gl.texImage3D(gl.TEXTURE_2D_ARRAY, level, gl.RGBA8, ...shape, 0, gl.RGBA, gl.UNSIGNED_BYTE, texels);
    });
    this.pavement = this.texture(gl.TEXTURE_2D, gl.CLAMP_TO_EDGE);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGB8, gl.RGB, gl.UNSIGNED_BYTE, picture);
    gl.generateMipmap(gl.TEXTURE_2D);
    this.take(header, block);
    this.standing = header.bodies;
    const { columns, shape } = header.marks.indices;
    gl.bindVertexArray(this.marks.walls.vertices);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    [this.textured, this.indexed] = [shape[0], columns[0][4]];
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(block, columns[0][1], this.indexed), gl.STATIC_DRAW);
  }

  texture(kind, wrap) {
    const { gl } = this;
    const made = gl.createTexture();
    gl.bindTexture(kind, made);
    gl.texParameteri(kind, gl.TEXTURE_MIN_FILTER, gl.LINEAR_MIPMAP_NEAREST);
    for (const axis of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(kind, axis, wrap);
    return made;
  }

  program(name, sources) {
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

  // The uniforms of a program by name, asked for when it is first used: until then drivers compile.
  uniforms(made) {
    const { gl } = this;
    if (made.places) return made.places;
    if (!gl.getProgramParameter(made, gl.LINK_STATUS)) {
      const logs = gl.getAttachedShaders(made).map((shader) => gl.getShaderInfoLog(shader));
      throw new Error(`a shader does not compile: ${gl.getProgramInfoLog(made)} ${logs.join(" ")}`);
    }
    const block = gl.getUniformBlockIndex(made, "Camera");
    if (block !== gl.INVALID_INDEX) gl.uniformBlockBinding(made, block, 0);
    const count = gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS);
    const names = Array.from({ length: count }, (_, i) => gl.getActiveUniform(made, i).name);
    made.places = names.map((name) => [name, gl.getUniformLocation(made, name)]).filter(([, place]) => place);
    return made.places;
  }

  // Take what the server has sent: a header and arrays.
  take({ marks = {}, bodies, order, camera, plan }, block) {
    for (const [name, { columns, ...style }] of Object.entries(marks)) {
      if (["indices", "level"].includes(style.kind)) continue;
      const mark = (this.marks[name] ??= { vertices: this.gl.createVertexArray(), columns: [], count: 0 });
      Object.assign(mark, style);
      for (const column of columns) this.fill(mark, column, block);
    }
    // Bodies that are not named are not to be seen, such as the map's walls from above.
    if (bodies) this.bodies = { ...this.standing, ...bodies };
    if (order) this.order = order;
    if (camera) this.look = camera;
    if (plan !== undefined) this.plan = plan;
    this.inset.hidden = !this.plan;
    this.stale = true;
  }

  // Rewrite an attribute from its first new row on; colours are four bytes, others so many floats.
  fill(mark, [place, start, size, first, count], block) {
    const { gl } = this;
    const stride = 4 * (size || 1);
    const { buffer, room } = mark.columns[place] ?? { room: 0 };
    if (count > room || !buffer) {
      const [wider, rows] = [gl.createBuffer(), first ? 2 * count : count];
      gl.bindVertexArray(mark.vertices);
      gl.bindBuffer(gl.ARRAY_BUFFER, wider);
      gl.bufferData(gl.ARRAY_BUFFER, stride * rows, gl.DYNAMIC_DRAW);
      gl.enableVertexAttribArray(place);
      if (size) gl.vertexAttribPointer(place, size, gl.FLOAT, false, 0, 0);
      else gl.vertexAttribPointer(place, 4, gl.UNSIGNED_BYTE, true, 0, 0);
      if (mark.kind === "lines") gl.vertexAttribDivisor(place, 1);
      if (first) {
        gl.bindBuffer(gl.COPY_READ_BUFFER, buffer);
        gl.copyBufferSubData(gl.COPY_READ_BUFFER, gl.ARRAY_BUFFER, 0, 0, stride * first);
      }
      gl.deleteBuffer(buffer ?? null);
      mark.columns[place] = { buffer: wider, room: rows };
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, mark.columns[place].buffer);
    gl.bufferSubData(gl.ARRAY_BUFFER, stride * first, new Uint8Array(block, start, stride * (count - first)));
    mark.count = count;
  }

  // Draw with a camera into a box of the canvas: left, bottom, width, height.
  see({ matrix, eye, thick, slack, nearer, focus }, [left, bottom, width, height]) {
    const { gl, camera } = this;
    gl.viewport(left, bottom, width, height);
    camera.set(matrix);
    camera.set([...eye, thick, width, height, slack, nearer], 16);
    gl.bindBuffer(gl.UNIFORM_BUFFER, this.block);
    gl.bufferData(gl.UNIFORM_BUFFER, camera, gl.DYNAMIC_DRAW);
    this.focus = focus;
  }

  paint(name, mark, uniforms = {}, { mode = this.gl.TRIANGLES, blend = false, cull = false, solid = !blend, span } = {}) {
    const { gl } = this;
    const made = this.programs[name];
    const count = span ? span[1] : mark.count;
    if (!count) return;
    (blend ? gl.enable : gl.disable).call(gl, gl.BLEND);
    (cull ? gl.enable : gl.disable).call(gl, gl.CULL_FACE);
    gl.depthMask(solid);
    const places = this.uniforms(made);
    gl.useProgram(made);
    for (const [uniform, place] of places) {
      const value = uniforms[uniform];
      if (value === undefined) continue;
      if (value.length === 16) gl.uniformMatrix4fv(place, false, value);
      else if (value.length) gl[`uniform${value.length}fv`](place, value);
      else gl.uniform1f(place, value);
    }
    gl.bindVertexArray(mark.vertices);
    if (span) gl.drawElements(mode, span[1], gl.UNSIGNED_INT, 4 * span[0]);
    else if (mark.kind === "lines") gl.drawArraysInstanced(gl.TRIANGLE_FAN, 0, 4, count);
    else gl.drawArrays(mode, 0, count);
    this.calls += 1;
  }

  render() {
    if (!this.look) return;
    const { gl, canvas, look, marks } = this;
    this.calls = 0;
    this.see(look, [0, 0, canvas.width, canvas.height]);
    gl.depthMask(true);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    for (const [name, pose] of Object.entries(this.bodies)) this.paint("faces", marks[name], { pose });
    gl.bindTexture(gl.TEXTURE_2D, this.pavement);
    this.paint("ground", marks.ground, { area: this.area });
    this.paint("sky", marks.sky, { below: 1, ray_from_corner: look.ray });
    // The nearest walls alone are seen through where they fade.
    gl.colorMask(!look.ghost, !look.ghost, !look.ghost, true);
    this.paintWalls();
    gl.colorMask(true, true, true, true);
    if (look.ghost) this.paintWalls();
    for (const name of this.order) this.paintMark(marks[name]);
    if (this.plan) this.paintPlan();
    canvas.dataset.calls = this.calls;
    this.stale = false;
  }

  paintWalls() {
    const { gl, look, textured, indexed } = this;
    const faded = look.ghost > 0 ? ":FADED" : "";
    const uniforms = { ghost: look.ghost, cut: look.cut };
    gl.bindTexture(gl.TEXTURE_2D_ARRAY, this.facades);
    const how = { cull: true, blend: look.ghost > 0, solid: true };
    this.paint(`walls:PLAIN${faded}`, this.marks.walls, uniforms, { ...how, span: [textured, indexed - textured] });
    this.paint(`walls${faded}`, this.marks.walls, uniforms, { ...how, span: [0, textured] });
  }

  paintMark(mark) {
    const { gl } = this;
    const { scale } = this.look;
    if (mark.kind === "points") {
      const sizes = [mark.size * this.focus, ...mark.pixels.map((size) => scale * size)];
      this.paint(mark.glows ? "points:GLOW_ROUND" : "points", mark, { sizes }, { mode: gl.POINTS, blend: true });
    } else if (mark.kind === "lines") {
      gl.depthFunc(mark.hidden ? gl.GREATER : gl.LEQUAL);
      this.paint(mark.hidden ? "lines:DASHED" : "lines", mark, { width: mark.width * scale }, { blend: true });
      gl.depthFunc(gl.LEQUAL);
    } else {
      this.paint("soft", mark, {}, { blend: true });
    }
  }

  // The map from above, in a corner of the picture.
  paintPlan() {
    const { gl, canvas, inset, ratio, plan } = this;
    const { left, top, width: side } = inset.getBoundingClientRect();
    const box = [left, canvas.clientHeight - top - side, side, side].map((value) => Math.round(ratio * value));
    gl.disable(gl.DEPTH_TEST);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(...box);
    gl.clearColor(...plan.back, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
    this.see(plan.camera, box);
    for (const name of plan.order) this.paintMark(this.marks[name]);
    gl.disable(gl.SCISSOR_TEST);
    gl.enable(gl.DEPTH_TEST);
  }
}
