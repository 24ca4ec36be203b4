// The scene that stands: sky, light, and the world and the robot from a GLB file.
// All is in the frame of the world less its origin, z up, in metres.

import { THREE, GLTFLoader } from "nicegui-scene";

const FAR = 4000;
const ROBOT = 0.75; // Width of the robot [m].
const MARKED = 30; // A robot of fewer pixels than this has a marker,
const MARKER = 26; // about as wide as this.

// A colour of screens, red, green and blue in 0…1.
export function paintOf([red, green, blue]) {
  return new THREE.Color().setRGB(red, green, blue, THREE.SRGBColorSpace);
}

// The same for a canvas, with its opacity.
export function css(colour, opacity = 1) {
  return `rgba(${colour.map((value) => Math.round(255 * value)).join(",")},${opacity})`;
}

export class Stage {
  constructor(place, { indoor, size, look }) {
    this.renderer = new THREE.WebGLRenderer({ antialias: true });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    place.appendChild(this.renderer.domElement);
    this.canvas = this.renderer.domElement;
    this.scene = new THREE.Scene();
    this.size = size;
    this.look = look;
    const haze = paintOf(look.haze);
    this.haze = new THREE.FogExp2(haze, indoor ? 0.004 : Math.min(0.0032, 0.7 / size));
    this.scene.background = haze;
    this.sky = skyDome(paintOf(look.zenith), haze);
    this.sky.visible = !indoor;
    this.indoor = indoor;
    this.scene.add(this.sky);
    // The sun stands in the file; this is the light of the sky and of the ground.
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0xb3a893, indoor ? 2.5 : 2.0));
    this.camera = new THREE.PerspectiveCamera(50, 1, 0.1, FAR);
    this.camera.up.set(0, 0, 1);
    this.resize(place);
    new ResizeObserver(() => this.resize(place)).observe(place);
  }

  resize(place) {
    const { clientWidth: width, clientHeight: height } = place;
    if (!width || !height) return;
    this.renderer.setSize(width, height);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
  }

  // Load the file; the robot's node is handed out, to be moved.
  async load(address) {
    const file = await new GLTFLoader().loadAsync(address);
    const root = file.scene;
    // The file has y up, as its format wants.
    root.rotation.x = Math.PI / 2;
    root.traverse((node) => {
      const { map, name } = node.material ?? {};
      if (map) map.anisotropy = this.renderer.capabilities.getMaxAnisotropy();
      // Marks and kerbs lie on the ground: far away, depths know no such small height.
      if (name === "strips") {
        Object.assign(node.material, { polygonOffset: true, polygonOffsetFactor: -2, polygonOffsetUnits: -8 });
      }
    });
    this.scene.add(root);
    this.root = root;
    this.robot = new THREE.Group();
    this.robot.rotation.order = "ZYX";
    const model = root.getObjectByName("robot");
    const upright = new THREE.Group();
    upright.add(model);
    this.marker = marker(this.look.robot);
    this.robot.add(upright, blob(this.look.shadow), this.marker);
    this.scene.add(this.robot);
  }

  place(pose) {
    this.robot.position.set(pose.x, pose.y, 0);
    this.robot.rotation.z = pose.theta;
  }

  // From high above there is no haze, and a robot too small to be seen has a marker.
  render(view) {
    const high = view === "top" || view === "orbit";
    this.scene.fog = high ? null : this.haze;
    const away = this.camera.position.distanceTo(this.robot.position);
    const pixel = (2 * away * Math.tan((this.camera.fov * Math.PI) / 360)) / this.canvas.clientHeight;
    this.marker.visible = high && MARKED * pixel > ROBOT;
    this.marker.scale.setScalar(MARKER * pixel);
    this.sky.visible = !this.indoor && view !== "top";
    this.renderer.render(this.scene, this.camera);
    const { calls, triangles } = this.renderer.info.render;
    Object.assign(this.canvas.dataset, { calls, triangles });
  }
}

// A dome whose colour goes from the haze at the horizon to the blue overhead.
function skyDome(zenith, haze) {
  const dome = new THREE.SphereGeometry(FAR * 0.9, 32, 24);
  dome.rotateX(Math.PI / 2);
  const places = dome.attributes.position;
  const colours = new Float32Array(3 * places.count);
  const colour = new THREE.Color();
  for (let i = 0; i < places.count; i++) {
    const up = places.getZ(i) / (FAR * 0.9);
    colour.copy(haze).lerp(zenith, Math.min(1, Math.max(0, up) * 1.8));
    colour.toArray(colours, 3 * i);
  }
  dome.setAttribute("color", new THREE.BufferAttribute(colours, 3));
  const material = new THREE.MeshBasicMaterial({
    vertexColors: true,
    side: THREE.BackSide,
    fog: false,
    depthWrite: false,
  });
  const mesh = new THREE.Mesh(dome, material);
  mesh.renderOrder = -1;
  return mesh;
}

// A dart over the robot, half as wide as its scale.
function marker({ colour, rim, dart }) {
  const outline = new THREE.Shape(dart.map(([x, y]) => new THREE.Vector2(x, y)));
  const paint = { depthTest: false, transparent: true, side: THREE.DoubleSide };
  const group = new THREE.Group();
  for (const [color, scale, order] of [
    [paintOf(rim), 1.25, 20],
    [paintOf(colour), 1.0, 21],
  ]) {
    const mesh = new THREE.Mesh(
      new THREE.ShapeGeometry(outline),
      new THREE.MeshBasicMaterial({ color, ...paint }),
    );
    mesh.scale.setScalar(0.5 * scale);
    mesh.renderOrder = order;
    group.add(mesh);
  }
  group.position.z = 1;
  return group;
}

// The soft shadow under the robot.
function blob(colour) {
  const canvas = document.createElement("canvas");
  canvas.width = canvas.height = 64;
  const draw = canvas.getContext("2d");
  const shade = draw.createRadialGradient(32, 32, 8, 32, 32, 32);
  shade.addColorStop(0, css(colour, 0.6));
  shade.addColorStop(1, css(colour, 0));
  draw.fillStyle = shade;
  draw.fillRect(0, 0, 64, 64);
  const material = new THREE.MeshBasicMaterial({
    map: new THREE.CanvasTexture(canvas),
    transparent: true,
    depthWrite: false,
  });
  const mesh = new THREE.Mesh(new THREE.PlaneGeometry(1.2, 1.2), material);
  mesh.position.z = 0.02;
  return mesh;
}
