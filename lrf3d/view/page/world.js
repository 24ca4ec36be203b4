// The scene: the world and its bodies from a GLB file, and the marks that the server sends.
// All is in the frame of the world less its origin, z up, in metres.

import { THREE, GLTFLoader } from "three";

import { Marks } from "./marks.js";

const FAR = 4000;

// What the film does to the colours of things: haze, ghosts of walls, and walls that are cut.
const AIR = `
  vec3 way = (there - cameraPosition) * thick;
  float far = dot(way, way);
  gl_FragColor.rgb = mix(gl_FragColor.rgb, haze, far / (1.0 + far));`;
const WALL = `
  vec2 out_there = there.xy - cut.xy;
  float toward = dot(out_there, cut.zw);
  float high = clamp(standing.x + slope * toward, standing.x, standing.y);
  if (slope > 0.0 && toward > 0.0 && there.z > high) discard;
  gl_FragColor = vec4(mix(gl_FragColor.rgb, ghost.rgb, faded), 1.0 - faded * ghost.a);`;

export class World {
  constructor(canvas, inset, setup) {
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    this.renderer.autoClear = false;
    Object.assign(this, { canvas, inset, setup, bodies: {}, plan: null });
    this.scene = new THREE.Scene();
    this.scene.background = screen(setup.haze);
    this.air = lens(setup.haze);
    this.flat = lens(setup.haze);
    this.walls = {
      cut: { value: new THREE.Vector4() },
      slope: { value: 0 },
      standing: { value: new THREE.Vector2(...setup.standing) },
      ghost: { value: new THREE.Vector4(...setup.ghost) },
      faded: { value: 0 },
    };
    this.planScene = new THREE.Scene();
    this.planScene.background = screen(setup.plan);
    this.marks = new Marks(this.scene, this.air, setup);
    this.planMarks = new Marks(this.planScene, this.flat, setup);
    this.camera = new THREE.PerspectiveCamera(50, 1, 0.1, FAR);
    this.camera.up.set(0, 0, 1);
    this.planCamera = new THREE.OrthographicCamera(-1, 1, 1, -1, 1, FAR);
    if (!setup.indoor) this.scene.add(sky(setup));
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.stale = true;
  }

  async load(address) {
    const { scene: root } = await new GLTFLoader().loadAsync(address);
    // The file has y up, as its format wants.
    root.rotation.x = Math.PI / 2;
    root.traverse((node) => {
      if (node.name === "robot" || node.name.startsWith("obstacle_")) {
        node.matrixAutoUpdate = false;
        this.bodies[node.name.replace("_", " ")] = node;
      }
      if (node.material) this.paint(node.material);
    });
    this.scene.add(root);
    this.solid = root.getObjectByName("walls");
  }

  paint(material) {
    const wall = material.name.startsWith("walls");
    if (material.map) material.map.anisotropy = this.renderer.capabilities.getMaxAnisotropy();
    if (wall) (this.wallMaterials ??= []).push(material);
    material.onBeforeCompile = (shader) => {
      Object.assign(shader.uniforms, this.air, this.walls);
      shader.vertexShader = "varying vec3 there;\n" + shader.vertexShader.replace(
        "#include <project_vertex>",
        "#include <project_vertex>\nthere = (modelMatrix * vec4(transformed, 1.0)).xyz;",
      );
      const known = "varying vec3 there;\nuniform vec3 haze;\nuniform float thick, slope, faded;\nuniform vec2 standing;\nuniform vec4 cut, ghost;\n";
      const after = AIR + (wall ? WALL : "");
      shader.fragmentShader = known + shader.fragmentShader.replace("#include <fog_fragment>", after);
    };
    material.customProgramCacheKey = () => (wall ? "wall" : "body") + Boolean(material.map);
  }

  // Take what the server has sent: a header and arrays.
  take({ marks = {}, order, bodies = {}, camera, plan }, block) {
    const both = [this.marks, this.planMarks];
    for (const [name, told] of Object.entries(marks)) {
      both[Number(name.startsWith("plan "))].update(name, told, block, both);
    }
    order?.forEach((name, i) => {
      for (const { meshes } of both) if (meshes[name]) meshes[name].renderOrder = 1 + i;
    });
    for (const [name, matrix] of Object.entries(bodies)) this.bodies[name]?.matrix.fromArray(matrix);
    for (const body of Object.values(this.bodies)) body.matrixWorldNeedsUpdate = true;
    if (camera) this.look(camera);
    if (plan !== undefined) this.plan = plan;
    this.inset.hidden = !this.plan;
    this.stale = true;
  }

  // The air of a look, walls that fade, and walls that are cut.
  look({ thick, nearer, slack, ghost, cut }) {
    const { air, walls } = this;
    [air.thick.value, air.nearer.value, air.slack.value] = [thick, nearer, slack];
    walls.faded.value = ghost;
    for (const material of this.wallMaterials ?? []) {
      if (material.transparent !== ghost > 0) material.needsUpdate = true;
      material.transparent = ghost > 0;
      material.depthWrite = ghost === 0;
    }
    walls.slope.value = cut ? cut[4] : 0;
    if (cut) walls.cut.value.fromArray(cut);
  }

  render() {
    const { renderer, camera, air, flat } = this;
    const { width, height } = this.canvas;
    air.viewport.value.set(width, height);
    air.pixel.value = Math.min(width, height) / 720;
    air.focus.value = height / 2 / Math.tan((camera.fov * Math.PI) / 360);
    renderer.clear();
    renderer.render(this.scene, camera);
    const { calls, triangles } = renderer.info.render;
    Object.assign(this.canvas.dataset, { calls, triangles });
    if (this.plan) {
      const [x, y, window] = this.plan;
      const { left, top, width: side } = this.inset.getBoundingClientRect();
      const box = [left, this.canvas.clientHeight - top - side, side, side];
      Object.assign(this.planCamera, { left: -window / 2, right: window / 2, top: window / 2, bottom: -window / 2 });
      this.planCamera.position.set(x, y, FAR / 2);
      this.planCamera.updateProjectionMatrix();
      flat.viewport.value.set(side, side).multiplyScalar(renderer.getPixelRatio());
      flat.pixel.value = air.pixel.value;
      renderer.setScissorTest(true);
      renderer.setScissor(...box);
      renderer.setViewport(...box);
      renderer.clear();
      renderer.render(this.planScene, this.planCamera);
      renderer.setScissorTest(false);
      renderer.setViewport(0, 0, this.canvas.clientWidth, this.canvas.clientHeight);
    }
    this.stale = false;
  }
}

// A colour of screens, red, green and blue in 0…1.
function screen([red, green, blue]) {
  return new THREE.Color().setRGB(red, green, blue, THREE.SRGBColorSpace);
}

// What the shaders of marks and things know of a picture; to start with, of one from straight above.
function lens(haze) {
  return {
    viewport: { value: new THREE.Vector2(1, 1) },
    haze: { value: new THREE.Vector3(...haze) },
    nearer: { value: 1e6 },
    slack: { value: 0 },
    thick: { value: 0 },
    pixel: { value: 1 },
    focus: { value: 1 },
  };
}

// A dome whose colour goes from the haze at the horizon to the blue overhead.
function sky({ haze, zenith }) {
  const dome = new THREE.SphereGeometry(0.9 * FAR, 32, 24);
  const material = new THREE.ShaderMaterial({
    vertexShader: `varying vec3 up;
      void main() { up = position; gl_Position = projectionMatrix * modelViewMatrix * vec4(position, 1.0); }`,
    fragmentShader: `varying vec3 up;
      uniform vec3 haze, zenith;
      void main() {
        float share = 1.0 - pow(1.0 - clamp(normalize(up).z, 0.0, 1.0), 2.6);
        gl_FragColor = vec4(mix(haze, zenith, share), 1.0);
      }`,
    uniforms: { haze: { value: haze }, zenith: { value: zenith } },
    side: THREE.BackSide,
    depthWrite: false,
  });
  const mesh = new THREE.Mesh(dome, material);
  mesh.renderOrder = -1;
  mesh.onBeforeRender = (_renderer, _scene, camera) => {
    mesh.position.copy(camera.position);
    mesh.updateMatrixWorld();
  };
  return mesh;
}
