// Marks as the film draws them: their arrays go into the buffers of the graphics card as they come.

import { THREE } from "three";

const COMMON = `
  uniform vec2 viewport;
  uniform vec3 haze;
  uniform float nearer, slack, thick, pixel, focus;
  // Where a point is drawn whose depth is that of a point nearer to the eye by so many metres.
  vec4 raised(vec3 place, float metres) {
    vec3 ray = cameraPosition - place;
    float away = length(ray);
    mat4 seen = projectionMatrix * viewMatrix;
    vec4 drawn = seen * vec4(place, 1.0);
    vec4 near = seen * vec4(place + ray / away * min(metres + slack * away, 0.5 * away), 1.0);
    drawn.z = near.z / near.w * drawn.w;
    return drawn;
  }
  // Whether what lies on a thin wall is seen: from the side that it faces, or from far above.
  bool shown(vec3 place, vec2 side) {
    return nearer > 1e3 || dot(cameraPosition.xy - place.xy, side) >= 0.0;
  }`;

const SHADERS = {
  faces: [
    `attribute vec4 tint;
    varying vec3 paint;
    void main() {
      vec3 way = (position - cameraPosition) * thick;
      float far = dot(way, way);
      paint = mix(tint.rgb, haze, far / (1.0 + far));
      gl_Position = projectionMatrix * viewMatrix * vec4(position, 1.0);
    }`,
    `varying vec3 paint;
    void main() { gl_FragColor = vec4(paint, 1.0); }`,
  ],
  soft: [
    `attribute vec4 tint;
    varying vec4 paint;
    void main() {
      paint = tint;
      gl_Position = raised(position, nearer > 1e3 ? nearer : 0.02);
    }`,
    `varying vec4 paint;
    void main() { gl_FragColor = paint; }`,
  ],
  lines: [
    `attribute vec2 corner;
    attribute vec3 start, end;
    attribute vec4 first, last;
    attribute vec2 side;
    uniform float width;
    varying vec4 paint;
    varying vec3 off;
    const float NEAR = 0.25;
    void main() {
      mat4 seen = projectionMatrix * viewMatrix;
      float wa = (seen * vec4(start, 1.0)).w;
      float wb = (seen * vec4(end, 1.0)).w;
      // What lies behind the eye is cut off before the division turns it round.
      vec4 a = raised(wa < NEAR && wb > NEAR ? mix(start, end, (NEAR - wa) / (wb - wa)) : start, nearer);
      vec4 b = raised(wb < NEAR && wa > NEAR ? mix(end, start, (NEAR - wb) / (wa - wb)) : end, nearer);
      vec2 way = (b.xy / b.w - a.xy / a.w) * viewport;
      vec2 across = normalize(vec2(-way.y, way.x) + vec2(1e-9, 0.0)) * corner.y;
      float half_width = 0.5 * width * pixel + 0.75;
      vec4 place = corner.x > 0.5 ? b : a;
      place.xy += across * half_width * 2.0 / viewport * place.w;
      // Divided by the last, this is straight in the picture and not in space.
      off = vec3(corner.y * half_width * place.w, corner.x * length(end - start), place.w);
      paint = corner.x > 0.5 ? last : first;
      if (!shown(start, side)) place.z = 2.0 * place.w;
      gl_Position = place;
    }`,
    `uniform float width, pixel, dash;
    varying vec4 paint;
    varying vec3 off;
    void main() {
      if (dash > 0.0 && fract(off.y / dash) > 0.6) discard;
      float cover = clamp(0.5 * width * pixel + 0.5 - abs(off.x / off.z), 0.0, 1.0);
      gl_FragColor = vec4(paint.rgb, paint.a * cover);
    }`,
  ],
  points: [
    `attribute vec4 tint;
    attribute vec2 side;
    uniform vec3 sizes;
    uniform vec2 halo;
    varying vec4 paint;
    varying float diameter;
    void main() {
      paint = tint;
      gl_Position = raised(position, nearer);
      if (!shown(position, side)) gl_Position.z = 2.0 * gl_Position.w;
      diameter = clamp(sizes.x * focus / gl_Position.w, sizes.y * pixel, sizes.z * pixel);
      gl_PointSize = max(halo.x, 1.0) * diameter + 1.0;
    }`,
    `uniform vec2 halo;
    varying vec4 paint;
    varying float diameter;
    void main() {
      float away = length(gl_PointCoord - 0.5) * (max(halo.x, 1.0) * diameter + 1.0);
      float cover = clamp(0.5 * diameter + 0.5 - away, 0.0, 1.0);
      vec3 colour = paint.rgb;
      if (halo.x > 0.0) {
        // The middle is white-hot, and light blooms round the point.
        colour = mix(colour, vec3(1.0), 0.6 * (1.0 - smoothstep(0.0, 0.4, away / diameter)));
        float bloom = max(1.0 - 2.0 * away / (halo.x * diameter), 0.0);
        cover = max(cover, halo.y * bloom * bloom);
      }
      gl_FragColor = vec4(colour, paint.a * cover);
    }`,
  ],
};

const TYPES = { f4: Float32Array, u1: Uint8Array };

export class Marks {
  // lens: the uniforms that all marks of a scene share.
  constructor(scene, lens, { dash, halo }) {
    Object.assign(this, { scene, lens, dash, halo, meshes: {} });
  }

  update(name, told, block, marks) {
    if (told === null) {
      this.scene.remove(this.meshes[name]);
      this.meshes[name].material.dispose();
      delete this.meshes[name];
      return;
    }
    if (told.kind) this.make(name, told);
    const mesh = this.meshes[name];
    if (told.as && told.as !== name) mesh.userData.as = () => marks.find((each) => each.meshes[told.as]).meshes[told.as].geometry;
    else if (told.as && mesh.userData.as) {
      delete mesh.userData.as;
      mesh.geometry = mesh.userData.own;
    }
    for (const [column, [type, from, length, size]] of Object.entries(told.columns ?? {})) {
      fill(mesh.userData.own, column, new TYPES[type](block, from, length), size);
    }
    if (mesh.userData.as) mesh.geometry = mesh.userData.as();
  }

  make(name, { kind, width = 0, hidden = false, sizes = [0, 0, 0], glows = false }) {
    const own = this.meshes[name]?.userData.own ?? (kind === "lines" ? bars() : new THREE.BufferGeometry());
    if (this.meshes[name]) this.scene.remove(this.meshes[name]);
    const [vertex, fragment] = SHADERS[kind];
    const material = new THREE.ShaderMaterial({
      vertexShader: COMMON + vertex,
      fragmentShader: fragment,
      uniforms: {
        ...this.lens,
        width: { value: width },
        dash: { value: hidden ? this.dash : 0 },
        sizes: { value: new THREE.Vector3(...sizes) },
        halo: { value: new THREE.Vector2(...(glows ? this.halo : [0, 0])) },
      },
      side: THREE.DoubleSide,
      transparent: kind !== "faces",
      depthWrite: kind === "faces",
      depthFunc: hidden ? THREE.GreaterDepth : THREE.LessEqualDepth,
    });
    const mesh = kind === "points" ? new THREE.Points(own, material) : new THREE.Mesh(own, material);
    // Bounds change with every moment, and marks are where one looks.
    mesh.frustumCulled = false;
    mesh.userData.own = own;
    this.meshes[name] = mesh;
    this.scene.add(mesh);
  }
}

// Two triangles for each line.
function bars() {
  const geometry = new THREE.InstancedBufferGeometry();
  const corners = new Float32Array([0, -1, 0, 1, 1, -1, 1, 1]);
  geometry.setAttribute("corner", new THREE.BufferAttribute(corners, 2));
  geometry.setIndex([0, 1, 2, 2, 1, 3]);
  return geometry;
}

// Put values into a column of a geometry; where there is too little room, more is made.
function fill(geometry, column, values, size) {
  const bytes = values instanceof Uint8Array;
  let attribute = geometry.getAttribute(column);
  if (!attribute || attribute.array.length < values.length) {
    geometry.dispose();
    const array = new values.constructor(size * Math.ceil((1.3 * values.length) / size));
    const kind = geometry.isInstancedBufferGeometry ? THREE.InstancedBufferAttribute : THREE.BufferAttribute;
    attribute = new kind(array, size, bytes);
    attribute.setUsage(THREE.DynamicDrawUsage);
    geometry.setAttribute(column, attribute);
  }
  attribute.array.set(values);
  attribute.needsUpdate = true;
  if (geometry.isInstancedBufferGeometry) geometry.instanceCount = values.length / size;
  else geometry.setDrawRange(0, values.length / size);
}
