// Renderer, camera and light; the scale bar and the axes over the picture. One length unit is the scene's size.
"use strict";

hydrograd.Stage = class {
  constructor(element, data) {
    this.size = data.size; // m
    this.up = new THREE.Vector3(...data.up);
    this.direction = new THREE.Vector3(...data.view_from);
    this.canvas = element.querySelector("#picture");
    this.overlay = element.querySelector("#overlay");
    this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, antialias: true, alpha: true });
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = THREE.PCFShadowMap;
    this.scene = new THREE.Scene();
    this.world = new THREE.Group(); // in m, from the scene's centre
    this.world.scale.setScalar(1 / this.size);
    this.scene.add(this.world);
    this.camera = new THREE.PerspectiveCamera(35, 1, 0.002, 50);
    this.camera.up.copy(this.up);
    this.controls = new THREE.OrbitControls(this.camera, this.canvas);
    this.controls.addEventListener("change", () => this.ask());
    this.light();
    this.wanted = true;
    this.resize();
    // At once: a canvas of another size is empty, and would be shown so until the next picture.
    new ResizeObserver(() => {
      this.resize();
      this.draw();
    }).observe(element);
    this.look(this.direction);
  }

  light() {
    const sky = new THREE.HemisphereLight(0xffffff, 0x93a8b5, 2.3);
    sky.position.copy(this.up);
    // From above, off to the side of the first view, so that shadows show depth.
    const side = new THREE.Vector3().crossVectors(this.direction, this.up).normalize();
    const sun = new THREE.DirectionalLight(0xffffff, 2.2);
    sun.position.copy(this.up).multiplyScalar(1.6).addScaledVector(this.direction, 0.9).addScaledVector(side, -0.8);
    sun.castShadow = true;
    sun.shadow.mapSize.set(2048, 2048);
    Object.assign(sun.shadow.camera, { left: -1, right: 1, top: 1, bottom: -1, near: 0.1, far: 4 });
    sun.shadow.bias = -0.0005;
    sun.shadow.normalBias = 0.004;
    this.scene.add(sky, sun);
  }

  /** Looks at the whole scene from a direction. */
  look(direction) {
    const half = (this.camera.fov * Math.PI) / 360;
    // All of the scene lies within half its size around its centre, and hardly anything near that.
    const narrow = Math.min(1, this.camera.aspect);
    const distance = 0.43 / Math.sin(Math.atan(narrow * Math.tan(half)));
    const from = direction.clone().normalize();
    // Along the upward axis the camera has no upright: a little beside it.
    if (Math.abs(from.dot(this.up)) > 0.999) {
      const aside = Math.abs(this.up.y) < 0.9 ? new THREE.Vector3(0, -1, 0) : new THREE.Vector3(1, 0, 0);
      from.addScaledVector(aside, 0.03).normalize();
    }
    this.controls.target.set(0, 0, 0);
    this.camera.position.copy(from.multiplyScalar(distance));
    this.controls.update();
    this.ask();
  }

  /** Moves camera and target along. */
  shift(by) {
    this.camera.position.add(by);
    this.controls.target.add(by);
    this.controls.update();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (!width || !height) return;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.overlay.width = width * ratio;
    this.overlay.height = height * ratio;
    this.ratio = ratio;
    this.ask();
  }

  /** Asks for a new picture. */
  ask() {
    this.wanted = true;
  }

  draw() {
    this.wanted = false;
    this.renderer.render(this.scene, this.camera);
    const pen = this.overlay.getContext("2d");
    pen.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    pen.clearRect(0, 0, this.overlay.width, this.overlay.height);
    pen.font = "12px system-ui, sans-serif";
    const height = this.overlay.height / this.ratio;
    this.axes(pen, 44, height - 44);
    this.scale(pen, 100, height - 22, height);
  }

  /** What is seen now, on a canvas of its own: background, picture, axes and scale. */
  picture() {
    this.draw();
    const out = document.createElement("canvas");
    [out.width, out.height] = [this.canvas.width, this.canvas.height];
    const pen = out.getContext("2d");
    const sky = pen.createLinearGradient(0, 0, 0, out.height);
    sky.addColorStop(0, hydrograd.color("--high"));
    sky.addColorStop(1, hydrograd.color("--low"));
    pen.fillStyle = sky;
    pen.fillRect(0, 0, out.width, out.height);
    // In the same task as it was drawn: the browser empties it afterwards.
    pen.drawImage(this.canvas, 0, 0);
    pen.drawImage(this.overlay, 0, 0);
    return out;
  }

  axes(pen, x, y) {
    const turn = this.camera.quaternion.clone().invert();
    const axes = [
      ["x", hydrograd.color("--x"), 1, 0, 0],
      ["y", hydrograd.color("--y"), 0, 1, 0],
      ["z", hydrograd.color("--z"), 0, 0, 1],
    ].map(([name, color, ...to]) => ({ name, color, to: new THREE.Vector3(...to).applyQuaternion(turn) }));
    axes.sort((a, b) => a.to.z - b.to.z); // what points away first
    pen.lineWidth = 2;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    for (const { name, color, to } of axes) {
      pen.strokeStyle = pen.fillStyle = color;
      pen.beginPath();
      pen.moveTo(x, y);
      pen.lineTo(x + 26 * to.x, y - 26 * to.y);
      pen.stroke();
      pen.fillText(name, x + 34 * to.x, y - 34 * to.y);
    }
  }

  /** A bar of a round length, as long as it looks at the point that the camera turns about. */
  scale(pen, x, y, height) {
    const distance = this.camera.position.distanceTo(this.controls.target);
    const metres = (2 * Math.tan((this.camera.fov * Math.PI) / 360) * distance * this.size) / height; // a pixel
    const length = hydrograd.round(110 * metres);
    pen.strokeStyle = pen.fillStyle = hydrograd.color("--ink");
    pen.lineWidth = 2;
    pen.beginPath();
    const end = x + length / metres;
    for (const [px, py] of [[x, -4], [x, 4], [x, 0], [end, 0], [end, -4], [end, 4]]) pen.lineTo(px, y + py);
    pen.stroke();
    pen.textAlign = "left";
    pen.textBaseline = "bottom";
    pen.fillText(hydrograd.metres(length), x + 5, y - 4);
  }
};

/** A colour of the page's style, which goes with the system's scheme. */
hydrograd.color = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

/** The largest of 1, 2 and 5 times a power of ten that isn't above a number. */
hydrograd.round = (number) => {
  const power = 10 ** Math.floor(Math.log10(number));
  return power * [5, 2, 1].find((digit) => digit * power <= number * (1 + 1e-9));
};

/** A length with its unit. */
hydrograd.metres = (length) => {
  const [factor, unit] = length >= 1000 ? [1e-3, "km"] : length >= 1 ? [1, "m"] : length >= 1e-3 ? [1e3, "mm"] : [1e6, "µm"];
  return `${Number((length * factor).toPrecision(3))} ${unit}`;
};
