// The robot in 3D: shapes are built once from its description, poses come as they change.
// three.js is large and comes last; a picture is drawn only when something has changed.

import { theme } from "./colours.js";

const FIELD = 0.571; // metres; the network's field of view
const VALUES = 7;
const EYE = [1.2, 0.85, 0.7]; // metres, base frame
const MIDDLE = [0.2, 0, 0.14];
let THREE = null;

export class RobotScene {
  constructor() {
    this.place = document.getElementById("robot");
    [this.canvas, this.note] = this.place.children;
    this.meshes = [];
    this.asked = false;
  }

  // Load three.js and draw what is known by then.
  async begin() {
    if (this.asked) return;
    this.asked = true;
    try {
      const library = await import("nicegui-scene");
      THREE = library.THREE;
      this.renderer = new THREE.WebGLRenderer({ antialias: true, canvas: this.canvas });
      this.light();
      this.controls = new library.OrbitControls(this.camera, this.canvas);
    } catch (error) {
      this.note.textContent = `No 3D here: ${error.message}`;
      return;
    }
    this.controls.target.set(...MIDDLE);
    this.controls.update();
    this.controls.addEventListener("change", () => this.redraw());
    new ResizeObserver(() => this.redraw()).observe(this.place);
    this.build(this.description);
  }

  light() {
    this.scene = new THREE.Scene();
    this.camera = new THREE.PerspectiveCamera(58, 2, 0.05, 20);
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(...EYE);
    const sun = new THREE.DirectionalLight(0xffffff, 0.3 * Math.PI);
    sun.position.set(5, 10, 40);
    this.root = new THREE.Group();
    this.scene.add(new THREE.AmbientLight(0xffffff, 0.7 * Math.PI), sun, this.root);
  }

  build(description) {
    this.description = description;
    if (!description || !this.controls) return;
    this.root.clear();
    this.meshes = description.shapes.map(([kind, size, colour]) => mesh(kind, size, colour));
    this.root.add(...this.meshes);
    if (description.table) this.root.add(tableTop(description.table));
    this.pose(this.latest ?? new Float32Array());
  }

  pose(values) {
    this.latest = values;
    this.meshes.forEach((item, index) => {
      const row = values.subarray(index * VALUES, (index + 1) * VALUES);
      if (row.length < VALUES) return;
      item.position.set(row[0], row[1], row[2]);
      item.quaternion.set(row[3], row[4], row[5], row[6]);
    });
    this.redraw();
  }

  redraw() {
    if (!this.controls || this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw();
    });
  }

  draw() {
    const { clientWidth: width, clientHeight: height } = this.place;
    if (!width || !height) return;
    this.renderer.setPixelRatio(window.devicePixelRatio);
    this.renderer.setSize(width, height);
    this.renderer.setClearColor(theme("surface"));
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.renderer.render(this.scene, this.camera);
  }
}

function mesh(kind, size, colour) {
  const material = new THREE.MeshPhongMaterial({ color: colour });
  if (kind === "box") return new THREE.Mesh(new THREE.BoxGeometry(...size), material);
  if (kind === "sphere") return new THREE.Mesh(new THREE.SphereGeometry(size[0], 20, 14), material);
  const geometry = new THREE.CylinderGeometry(size[0], size[0], size[1], 24);
  geometry.rotateX(Math.PI / 2); // three.js has cylinders along y, URDF along z
  return new THREE.Mesh(geometry, material);
}

function tableTop(matrix) {
  const group = new THREE.Group();
  const board = new THREE.Mesh(
    new THREE.BoxGeometry(0.7, 1.1, 0.02),
    new THREE.MeshPhongMaterial({ color: "#b9a88f" }),
  );
  board.position.z = -0.012;
  const field = new THREE.Mesh(
    new THREE.PlaneGeometry(FIELD, FIELD),
    new THREE.MeshPhongMaterial({ color: "#d8cbb5" }),
  );
  group.add(board, field);
  group.applyMatrix4(new THREE.Matrix4().set(...matrix));
  return group;
}
