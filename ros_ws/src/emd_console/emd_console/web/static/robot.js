// The robot in 3D: shapes are built once from its description, poses come as they change.

import { THREE } from "nicegui-scene";
import { theme } from "./colours.js";

const FIELD = 0.571; // metres; the network's field of view
const VALUES = 7;

export class RobotScene {
  constructor(elementId) {
    this.elementId = elementId;
    this.root = new THREE.Group();
    this.meshes = [];
  }

  get component() {
    return typeof getElement === "function" ? getElement(this.elementId) : null;
  }

  build(description) {
    if (!description) return;
    this.description = description;
    const component = this.component;
    if (!component?.scene) {
      setTimeout(() => this.build(this.description), 200);
      return;
    }
    this.root.removeFromParent();
    this.root = new THREE.Group();
    this.meshes = description.shapes.map(([kind, size, colour]) => mesh(kind, size, colour));
    this.root.add(...this.meshes);
    if (description.table) this.root.add(tableTop(description.table));
    component.scene.add(this.root);
    this.recolour();
    if (this.latest) this.pose(this.latest);
  }

  pose(values) {
    this.latest = values;
    this.meshes.forEach((item, index) => {
      const row = values.subarray(index * VALUES, (index + 1) * VALUES);
      if (row.length < VALUES) return;
      item.position.set(row[0], row[1], row[2]);
      item.quaternion.set(row[3], row[4], row[5], row[6]);
    });
  }

  recolour() {
    this.component?.renderer?.setClearColor(theme("surface"));
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
