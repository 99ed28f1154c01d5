// What stands on the stage: bodies, their paths, walls, and a grid where there is no floor.
"use strict";

/** Turns between faces up to this are smoothed, rad: round shapes look round, edges stay. */
const CREASE = 0.61;

hydrograd.Bodies = class {
  constructor(data, frames, stage) {
    this.frames = frames;
    this.stage = stage;
    this.groups = data.bodies.map((body) => this.body(body));
    this.paths = data.bodies.map((body, number) => this.path(body, number));
    this.groups.forEach((group) => stage.world.add(group));
    this.paths.forEach((path) => stage.world.add(path));
  }

  get meshes() {
    return this.groups.filter((group) => group.userData.skin).length;
  }

  body(body) {
    const group = new THREE.Group();
    group.userData.middle = new THREE.Vector3(...body.middle);
    if (!body.vertices) {
      group.add(this.cross());
      return group;
    }
    // three.js takes vertices for one that are 1e-5 apart: measured in the body's own size, wherever its frame is.
    const middle = group.userData.middle.toArray();
    const vertices = hydrograd.decode(body.vertices).map((x, i) => x - middle[i % 3]);
    const unit = vertices.reduce((most, x) => Math.max(most, Math.abs(x)), 0) || 1;
    const indexed = new THREE.BufferGeometry();
    indexed.setAttribute("position", new THREE.BufferAttribute(vertices.map((x) => x / unit), 3));
    indexed.setIndex(new THREE.BufferAttribute(new Uint32Array(hydrograd.decode(body.faces)), 1));
    const material = new THREE.MeshStandardMaterial({ color: body.color, roughness: 0.6, metalness: 0.0 });
    const skin = new THREE.Mesh(THREE.toCreasedNormals(indexed, CREASE), material);
    skin.castShadow = skin.receiveShadow = true;
    const thin = new THREE.LineBasicMaterial({ color: 0x102030, transparent: true, opacity: 0.35 });
    const lines = new THREE.LineSegments(new THREE.WireframeGeometry(indexed), thin);
    lines.visible = false;
    for (const part of [skin, lines]) {
      part.position.copy(group.userData.middle);
      part.scale.setScalar(unit);
    }
    group.add(skin, lines);
    Object.assign(group.userData, { skin, lines });
    return group;
  }

  /** A body without a shape: the axes of its frame. */
  cross() {
    const r = 0.03 * this.stage.size;
    const ends = new Float32Array([-r, 0, 0, r, 0, 0, 0, -r, 0, 0, r, 0, 0, 0, -r, 0, 0, r]);
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(ends, 3));
    return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: 0x24343f }));
  }

  /** Where the middle of a body's surface went. */
  path(body, number) {
    const points = new Float32Array(3 * this.frames.count);
    const [p, r] = [new THREE.Vector3(), new THREE.Quaternion()];
    const middle = new THREE.Vector3(...body.middle);
    for (let frame = 0; frame < this.frames.count; frame++) {
      this.frames.pose(number, { frame, share: 0 }, p, r);
      p.add(middle.clone().applyQuaternion(r)).toArray(points, 3 * frame);
    }
    const geometry = new THREE.BufferGeometry();
    geometry.setAttribute("position", new THREE.BufferAttribute(points, 3));
    const line = new THREE.Line(geometry, new THREE.LineBasicMaterial({ color: body.color }));
    line.visible = false;
    return line;
  }

  place(at) {
    this.groups.forEach((group, body) => this.frames.pose(body, at, group.position, group.quaternion));
  }

  /** The middle of a body's surface, in the stage's units. */
  middle(body) {
    const { position, quaternion, userData } = this.groups[body];
    const point = userData.middle.clone().applyQuaternion(quaternion).add(position);
    return point.multiplyScalar(1 / this.stage.size);
  }

  show(body, shown) {
    this.groups[body].visible = shown;
  }

  edges(shown) {
    for (const { userData } of this.groups) if (userData.lines) userData.lines.visible = shown;
  }

  trails(shown) {
    for (const path of this.paths) path.visible = shown;
  }

  glass(seen) {
    for (const { userData } of this.groups) {
      if (!userData.skin) continue;
      Object.assign(userData.skin.material, { transparent: seen, opacity: seen ? 0.4 : 1, depthWrite: !seen });
      userData.skin.material.needsUpdate = true;
      userData.skin.castShadow = !seen;
    }
  }
};

/** Lines of a grid in the plane z = 0, `cells` of `cell` m to each side. */
hydrograd.grid = (cell, cells, color, opacity) => {
  const ends = [];
  const far = cell * cells;
  for (let i = -cells; i <= cells; i++) {
    ends.push(i * cell, -far, 0, i * cell, far, 0, -far, i * cell, 0, far, i * cell, 0);
  }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(ends), 3));
  const material = new THREE.LineBasicMaterial({ color, transparent: true, opacity, depthWrite: false });
  return new THREE.LineSegments(geometry, material);
};

/** The scene's walls, each a plane with a grid; without any, a grid below everything. Gives the grid's cell, m. */
hydrograd.addWalls = (data, stage) => {
  const cell = hydrograd.round(data.size / 8);
  const cells = Math.ceil((1.1 * data.size) / cell);
  const upward = new THREE.Vector3(0, 0, 1);
  for (const wall of data.walls) {
    const normal = new THREE.Vector3(...wall.normal);
    const group = new THREE.Group();
    group.position.set(...wall.point);
    group.quaternion.setFromUnitVectors(upward, normal);
    const free = wall.surface === "free";
    const floor = !free && normal.dot(stage.up) > 0.7;
    // Seen from behind, a wall isn't drawn: it would hide what it encloses.
    const material = new THREE.MeshLambertMaterial({
      color: hydrograd.color(free ? "--water" : floor ? "--floor" : "--wall"),
      side: free ? THREE.DoubleSide : THREE.FrontSide,
      transparent: !floor,
      opacity: floor ? 1 : free ? 0.25 : 0.45,
      depthWrite: floor,
      polygonOffset: true,
      polygonOffsetFactor: 1,
      polygonOffsetUnits: 1,
    });
    const plane = new THREE.Mesh(new THREE.PlaneGeometry(2 * cell * cells, 2 * cell * cells), material);
    plane.receiveShadow = !free;
    group.add(plane, hydrograd.grid(cell, cells, 0x45545f, 0.3));
    stage.world.add(group);
  }
  if (data.walls.length === 0) {
    const grid = hydrograd.grid(cell, cells, 0x45545f, 0.3);
    grid.quaternion.setFromUnitVectors(upward, stage.up);
    grid.position.copy(stage.up).multiplyScalar(data.lowest);
    stage.world.add(grid);
  }
  return cell;
};
